"""Compare two machines of one kind in one calibration, such as the left and the right leg of a quadruped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from discrepancy.joints.fit import Parameter
from discrepancy.joints.quantities import described
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.statistics import measured

ALIKE = (
    "armature_", "coulomb_", "viscous_", "gain", "position_gain_", "limit_", "command_delay_", "delay_", "braking_",
    "mass_", "inertia_xx", "inertia_yy", "inertia_zz",
)  # fmt: skip
"""Quantities that a machine shares with its mirror image, by the begin of their names."""
CERTAIN = 0.01
"""Probability that two equal machines are told to differ."""


@dataclass(frozen=True)
class Difference:
    """One quantity of two machines.

    Attributes:
        places: joint or link of both.
        name: quantity with its unit, such as ``coulomb_Nm``.
        values: of both.
        se: standard error of the first value minus the second.
    """

    places: tuple[str, str]
    name: str
    values: tuple[float, float]
    se: float

    @property
    def size(self) -> float:
        """Difference over its standard error."""
        return abs(self.values[0] - self.values[1]) / self.se


@dataclass(frozen=True)
class Comparison:
    """What two machines share.

    Attributes:
        names: parts of the names by which their joints and links differ.
        differences: of quantities that the logs determine in both.
        probability: that equal machines differ by as much, together.
    """

    names: tuple[str, str]
    differences: tuple[Difference, ...]
    probability: float

    @property
    def unlike(self) -> list[Difference]:
        """Differences that equal machines seldom have, largest first; the bound holds for all together (Sidak 1967)."""
        bound = norm.isf(0.5 * (1.0 - (1.0 - CERTAIN) ** (1.0 / max(len(self.differences), 1))))
        return sorted((d for d in self.differences if d.size > bound), key=lambda d: -d.size)

    @property
    def sentence(self) -> str:
        """Whether they differ."""
        both, count = " and ".join(self.names), len(self.differences)
        if self.unlike:
            listed = ", ".join(f"{described(d.name)[0]} of {d.places[0]}" for d in self.unlike)
            return f"{both} differ by more than their errors in {len(self.unlike)} of {count} quantities: {listed}."
        if not count:
            return f"The logs determine no quantity of both {both}, so they cannot be compared."
        if self.probability < CERTAIN:
            return f"{both} differ by more than their errors, but in no single one of {count} quantities."
        return f"{both} agree within their errors in all of {count} quantities."

    def lines(self) -> Iterator[str]:
        """The sentence and a table."""
        yield self.sentence
        if not self.differences:
            return
        heads = [
            f"{described(d.name)[0]} of {d.places[0]} [{described(d.name)[1]}]" for d in self.differences
        ]
        width = max(map(len, heads))
        yield f" {'':<{width + 1}}" + "".join(f"{name:>12}" for name in self.names) + "   difference"
        for head, d in zip(heads, self.differences, strict=True):
            scale = described(d.name)[2]
            first, second = (scale * x for x in d.values)
            off, error = measured(first - second, scale * d.se)
            yield f"  {head:<{width}}{first:>12.4g}{second:>12.4g}   {off} +- {error}"


def machines(joints: Sequence[str], same: str) -> tuple[str, str]:
    """Read LEFT=RIGHT, parts of the names by which the joints and links of two machines differ.

    Args:
        joints: names of the robot's joints.
        same: the text.

    Raises:
        InputError: the text has another form, or no two joints differ so.
    """
    left, _, right = same.partition("=")
    if not left or not right or left == right:
        raise InputError(
            f"same is {same!r}; it must be LEFT=RIGHT, such as FL=FR for FL_hip_joint and FR_hip_joint"
        )
    if not any(left in name and name.replace(left, right, 1) in joints for name in joints):
        raise InputError(
            f"same is {same!r}, but no joint with {left!r} in its name has one with {right!r} instead; "
            f"the robot's joints are {', '.join(joints)}"
        )
    return left, right


def compared(parameters: Sequence[Parameter], covariance: Array, names: tuple[str, str]) -> Comparison:
    """Compare the determined quantities of two machines that mirror images share.

    Args:
        parameters: parameters of a calibration.
        covariance: their covariance, shape (P, P).
        names: as ``machines`` reads them.
    """
    index = {
        (p.place, p.name): k for k, p in enumerate(parameters) if p.determined and p.name.startswith(ALIKE)
    }
    twins = {k: (place.replace(*names, 1), name) for (place, name), k in index.items() if names[0] in place}
    pairs = [(k, index[twin]) for k, twin in twins.items() if twin in index]
    turn = np.zeros((len(pairs), len(parameters)))
    for row, (i, k) in zip(turn, pairs, strict=True):
        row[i], row[k] = 1.0, -1.0
    spread, off = turn @ covariance @ turn.T, turn @ np.array([p.value for p in parameters])
    se = np.sqrt(np.diag(spread))
    alike = np.linalg.pinv(spread / np.outer(se, se), rcond=1e-9, hermitian=True)
    differences = [
        Difference((a.place, b.place), a.name, (a.value, b.value), s)
        for a, b, s in (
            (parameters[i], parameters[k], s) for (i, k), s in zip(pairs, se.tolist(), strict=True)
        )
    ]
    together = float(chi2.sf(off / se @ alike @ (off / se), max(len(pairs), 1)))
    return Comparison(names, tuple(differences), together)
