"""What every cause of a serial robot offers the diagnosis."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from discrepancy.candidate import Parameter
from discrepancy.causes import base
from discrepancy.causes.base import Shape
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.mechanics.tree import Tree
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array

Part = Literal["joint", "link", "pair", "arm"]
SLIDES = {
    "Nms_per_rad": "Ns_per_m",
    "Nm_per_rad": "N_per_m",
    "rad_per_Nm": "m_per_N",
    "Nm": "N",
    "rad": "m",
    "kgm2": "kg",
}
"""Units of a joint that turns, and of one that slides."""


@dataclass(frozen=True, eq=False)
class Hints:
    """What shapes of causes begin with; one number a joint, shape (J,), unless said.

    Attributes:
        typical: speed while it moves [rad/s or m/s].
        slow: speed below which the direction of friction fades [rad/s or m/s].
        load: typical torque of the nominal model without friction [N m or N].
        travel, middle: range of positions, and its middle [rad or m].
        turns: periods of a ripple in one unit of joint position that are tried, per joint.
        couplings: how many times a joint's motor turns when the joint before it turns once, in units of its own
            joint's turns, if the map says so; else NaN.
        unscaled: whether what a joint's drive gives per volt or ampere was fitted.
        switched: whether a joint's drive is given a voltage, and the joint moves while it is off, too.
        longest_s: of the logs, the duration of the longest.
    """

    typical: Array
    slow: Array
    load: Array
    travel: Array
    middle: Array
    turns: Sequence[Sequence[float]]
    couplings: Array
    switched: NDArray[np.bool_]
    unscaled: NDArray[np.bool_]
    longest_s: float


class Cause(base.Cause):
    """One physical cause: what it adds to the nominal residual per unit of each parameter.

    Attributes:
        part: where it sits.
        dry: whether it jumps where a joint turns round.
        built: whether it is how the robot was made, and so the same on two days.
        reversible: whether, between two days, it may as well have gone as come.
        alike: how many shapes at every place are equally likely beforehand; 0 where that is not charged.
        merges: whether it becomes a part of a link in the tree, whose own numbers are meant without it.
        laden: whether its columns depend on all that hangs on the arm.
        moves: whether its joint is elsewhere than it reads.
    """

    where = "arm"
    part: ClassVar[Part] = "joint"
    dry: ClassVar[bool] = False
    built: ClassVar[bool] = False
    reversible: ClassVar[bool] = False
    alike: ClassVar[int] = 0
    merges: ClassVar[bool] = False
    laden: ClassVar[bool] = False
    moves: ClassVar[bool] = False

    @abstractmethod
    def columns(self, signals: Signals, at: int, shape: Shape) -> Array:
        """What one unit of each parameter adds to the measured torques, shape (W, J, k).

        Args:
            signals: of one log.
            at: which joint (for a link: that which moves it), from 0; -1 of the whole arm.
            shape: numbers inside the columns.
        """

    def exact(self, signals: Signals, at: int, values: Array, shape: Shape) -> Array:
        """What the given values add, shape (W, J), where that is not linear in them."""
        return self.columns(signals, at, shape) @ values

    def slopes(self, model: Signals, signals: Signals, at: int, shape: Shape) -> Array:
        """Columns where the tree has other numbers and the joints other zeros than the model, shape (W, J, k)."""
        return self.columns(signals, at, shape)

    def by_load(self, signals: Signals, at: int, values: Array, shape: Shape, torque: Array) -> Array:
        """What it adds for a little more torque asked for, over that, shape (W, J) -> (W, J); if it is laden."""
        more = replace(signals, inverse=signals.inverse + rules.LOAD_STEP * torque)
        both = (self.exact(one, at, values, shape) for one in (more, signals))
        return (next(both) - next(both)) / rules.LOAD_STEP

    def applied(self, signals: Signals, at: int, values: Array, shape: Shape) -> Signals | None:
        """The signals with its values in the tree and the motion, the torques asked for left alone; None: not there."""
        return None

    def shapes(self, hints: Hints, at: int) -> Sequence[Shape]:
        """Alternatives of what changes the columns themselves; the first is the catalogue's. None: not here."""
        return [{}]

    def finer(self, shape: Shape) -> Sequence[Shape]:
        """Shapes near a chosen one, for a second look."""
        return []

    def closer(self, shape: Shape) -> Sequence[Shape]:
        """Shapes of which a value is larger for the same trace, little by little."""
        return []

    def steps(self, shape: Shape) -> Mapping[str, float]:
        """Numbers of a shape that the data determine, and over which to take differences."""
        return {}

    def normal(self, tree: Tree, at: int) -> Sequence[float]:
        """Standard deviations that are no news, one a parameter; 0 of an event."""
        return self.tolerances or [0.0] * len(self.parameters)

    def sizes(self, tree: Tree, at: int) -> Sequence[float]:
        """Typical sizes, one a parameter."""
        return self.scales or self.tolerances

    def most(self, tree: Tree, at: int) -> Sequence[float] | None:
        """Sizes beyond which it is no such thing, one a parameter; None without any."""
        return None

    def possible(self, tree: Tree, at: int, values: Array, se: Array) -> bool:
        """Whether such values can be, beyond two standard errors."""
        return self.never_negative(values, se)

    def stands_out(self, values: Array, shape: Shape) -> bool:
        """Whether it is more in such a shape than what every robot has."""
        return True

    def at(
        self,
        tree: Tree,
        names: Sequence[str],
        at: int,
        shape: Shape,
        given: Mapping[str, float] | None = None,
    ) -> SerialCandidate:
        """The cause at a place.

        Args:
            tree: the nominal one.
            names: of the joints.
            at: as of ``columns``.
            shape: numbers inside its columns.
            given: standard deviations that are no news, by parameter; None for the defaults.
        """
        slide = at >= 0 and self.part in ("joint", "pair") and bool(tree.slides[at])
        named = [parameter_name(name, slide=slide) for name in self.parameters]
        normal = self.normal(tree, at) if given is None else [given[name] for name in self.parameters]
        sizes = self.sizes(tree, at)
        parameters = tuple(
            Parameter(n, float(t), float(s)) for n, t, s in zip(named, normal, sizes, strict=True)
        )
        most = self.most(tree, at)
        spread = np.inf if most is None or not all(normal) else _spread(most, normal)
        before = None if self.part != "pair" else partner(tree, at)
        return SerialCandidate(
            self.name, self.family, None, at + 1 if at >= 0 else None, parameters, dict(shape), where=self.where,
            title=self.title, part=self.part, called=names[at] if at >= 0 else "", slide=slide,
            partner=None if before is None else before + 1, most_spread=spread,
        )  # fmt: skip


def _spread(most: Sequence[float], normal: Sequence[float]) -> float:
    """Of a kind over its tolerance, if nineteen in twenty of it can be."""
    return max(1.0, float(np.min(np.divide(most, normal))) / rules.MOST_SE)


def parameter_name(name: str, *, slide: bool) -> str:
    """Name of a parameter with the unit of a joint that turns or slides."""
    if slide:
        for turning, sliding in SLIDES.items():
            if name.endswith(f"_{turning}"):
                return f"{name.removesuffix(turning)}{sliding}"
    return name


def partner(tree: Tree, at: int) -> int | None:
    """The joint before another on its way to the base; None if it is the first."""
    moved = tree.moved[:, tree.joint_body[at]].copy()
    moved[at:] = False
    return int(np.flatnonzero(moved)[-1]) if moved.any() else None


def at_joint(signals: Signals, at: int, *columns: Array) -> Array:
    """Columns (W,) that act on one joint, shape (W, J, k)."""
    out = np.zeros((len(signals.time), signals.q.shape[1], len(columns)))
    for k, column in enumerate(columns):
        out[:, at, k] = column
    return out


def direction(signals: Signals, at: int, slow: float) -> Array:
    """Direction of a joint's motion in [-1, 1], shape (W,); it fades below a speed."""
    return np.clip(signals.dq[:, at] / slow, -1.0, 1.0)


def slow_shapes(hints: Hints, at: int, shares: Sequence[float]) -> list[Shape]:
    """Speeds over which the direction of friction fades, as shares of the joint's typical one, if they can be told."""
    told = (max(share * float(hints.typical[at]), float(hints.slow[at])) for share in shares)
    return [{"slow_per_s": speed} for speed in dict.fromkeys(told)]
