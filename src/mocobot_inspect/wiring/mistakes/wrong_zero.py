"""Angles or positions that count from elsewhere."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from estimator.arm.delta import inverse_kinematics
from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import Mistake, channel_names, teams

STEP_RAD = float(np.deg2rad(15.0))
STEPS = tuple(k for k in range(-6, 7) if k)
"""Offsets of one joint that are tried, in steps, before the best is refined."""


@dataclass(frozen=True)
class CountsFromElsewhere(Mistake):
    """All positions relative to another posture, or counted the other way.

    Attributes:
        words: the same in words.
        sign: of the logged positions.
        offset: to be added to them then [rad or m], three numbers.
    """

    words: str
    sign: int
    offset: tuple[float, ...]

    def undo(self, signals: Signals) -> Signals:
        turned = signals.position.arranged(self.robots, (0, 1, 2), (self.sign,) * 3)
        return signals.having("position", turned.shifted(self.robots, self.offset))

    def what(self) -> str:
        return self.words

    def subject(self) -> str:
        return f"zero of {self.named}"


@dataclass(frozen=True)
class WrongZero(Mistake):
    """One encoder with another zero, of one robot or of all: an offset of the map is missing, or has the wrong sign.

    Attributes:
        joint: which of the three.
        offset_rad: to be added to what it reads [rad].
    """

    joint: int
    offset_rad: float

    def undo(self, signals: Signals) -> Signals:
        (group,) = self.groups
        offset = [self.offset_rad * (k == self.joint) for k in range(3)]
        return signals.having(group, signals.group(group).shifted(self.robots, offset))

    @property
    def channels(self) -> tuple[str, ...]:
        return (channel_names(self.level, self.groups[0])[self.joint],)

    def subject(self) -> str:
        return f"zero of {self.channels[0]}"

    def what(self) -> str:
        amount = np.rad2deg(abs(self.offset_rad))
        of_all = len(self.robots) == self.team > 1
        why = (
            f" (the map lacks an offset, or has one of {amount / 2:.1f} deg with the wrong sign)"
            if of_all
            else ""
        )
        return f"{self.channels[0]} reads {amount:.1f} deg too {'little' if self.offset_rad > 0 else 'much'}{why}"

    def refined(self, total: Callable[[Mistake], float]) -> Mistake:
        found = minimize_scalar(
            lambda offset: min(total(replace(self, offset_rad=float(offset))), 1e12),
            bounds=(self.offset_rad - STEP_RAD, self.offset_rad + STEP_RAD),
            method="bounded",
            options={"xatol": 1e-3},
        )
        return replace(self, offset_rad=float(found.x))

    def to_dict(self) -> dict[str, Any]:
        return super().to_dict() | {"offset_rad": self.offset_rad}


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Conventions of all robots and of each, then every encoder, of all robots and of each."""
    level, N = signals.level, signals.robots
    home = np.array([0.0, 0.0, design.home_height_m])
    x, y, z = (float(x) for x in (inverse_kinematics(home, design) if level == "joint" else home))
    what, unit = ("phi counts", "rad") if level == "joint" else ("h is measured", "m")
    at_home = f"{what} from the home posture at ({x:.4g}, {y:.4g}, {z:.4g}) {unit}"
    positions: tuple[Kind, ...] = ("position",)
    for robots in teams(N):
        yield CountsFromElsewhere("counts_from_home", level, robots, N, positions, at_home, 1, (x, y, z))
        for sign, way in ((-1, "outward and down"), (1, "the right way round")) if level == "joint" else ():
            words, up = f"phi counts from the vertical, {way}", (np.pi / 2,) * 3
            yield CountsFromElsewhere("counts_from_vertical", level, robots, N, positions, words, sign, up)
    groups: tuple[Kind, ...] = ("position", "theta") if level == "joint" else ("theta",)
    for robots, group, joint, k in product(teams(N), groups, range(3), STEPS):
        yield WrongZero("wrong_zero", level, robots, N, (group,), joint, k * STEP_RAD)
