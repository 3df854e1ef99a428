"""Angles or positions that count from elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import minimize_scalar

from estimator.arm.delta import inverse_kinematics
from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import NAMES, Mistake, channel_names, teams

STEP_RAD = float(np.deg2rad(15.0))
STEPS = tuple(k for k in range(-6, 7) if k)
"""Offsets of one joint that are tried, in steps, before the best is refined."""


@dataclass(frozen=True)
class CountsFromHome(Mistake):
    """All positions relative to the home posture.

    Attributes:
        offset: position at home [rad or m].
    """

    offset: tuple[float, float, float]

    kind: ClassVar[str] = "counts_from_home"

    def undo(self, signals: Signals) -> Signals:
        """See ``Mistake.undo``."""
        return signals.having("position", signals.position.shifted(self.robots, self.offset))

    @property
    def channels(self) -> tuple[str, ...]:
        """See ``Mistake.channels``."""
        return channel_names(self.level, "position")

    def subject(self) -> str:
        """See ``Mistake.subject``."""
        return f"zero of {NAMES[self.level]['position']}"

    def what(self) -> str:
        """See ``Mistake.what``."""
        at = ", ".join(f"{value:.4g}" for value in self.offset)
        what, unit = ("phi counts", "rad") if self.level == "joint" else ("h is measured", "m")
        return f"{what} from the home posture at ({at}) {unit}"


@dataclass(frozen=True)
class CountsFromVertical(Mistake):
    """Driven angles counted from the vertical, upward or outward."""

    sign: int

    kind: ClassVar[str] = "counts_from_vertical"

    def undo(self, signals: Signals) -> Signals:
        """See ``Mistake.undo``."""
        turned = signals.position.arranged(self.robots, (0, 1, 2), (self.sign,) * 3)
        return signals.having("position", turned.shifted(self.robots, (np.pi / 2,) * 3))

    @property
    def channels(self) -> tuple[str, ...]:
        """See ``Mistake.channels``."""
        return channel_names(self.level, "position")

    def subject(self) -> str:
        """See ``Mistake.subject``."""
        return f"zero of {NAMES[self.level]['position']}"

    def what(self) -> str:
        """See ``Mistake.what``."""
        way = "outward and down" if self.sign < 0 else "the right way round"
        return f"phi counts from the vertical, {way}"


@dataclass(frozen=True)
class WrongZero(Mistake):
    """One encoder with another zero.

    Attributes:
        group: driven angles or gimbal angles.
        joint: which of the three.
        offset_rad: to be added to what it reads [rad].
    """

    group: Kind
    joint: int
    offset_rad: float

    kind: ClassVar[str] = "wrong_zero"

    def undo(self, signals: Signals) -> Signals:
        """See ``Mistake.undo``."""
        offset = np.zeros(3)
        offset[self.joint] = self.offset_rad
        return signals.having(self.group, signals.group(self.group).shifted(self.robots, offset.tolist()))

    @property
    def channels(self) -> tuple[str, ...]:
        """See ``Mistake.channels``."""
        return (channel_names(self.level, self.group)[self.joint],)

    def subject(self) -> str:
        """See ``Mistake.subject``."""
        return f"zero of {self.channels[0]}"

    def what(self) -> str:
        """See ``Mistake.what``."""
        amount = np.rad2deg(abs(self.offset_rad))
        return f"{self.channels[0]} reads {amount:.1f} deg too {'little' if self.offset_rad > 0 else 'much'}"

    def refined(self, total: Callable[[Mistake], float]) -> Mistake:
        """See ``Mistake.refined``."""
        found = minimize_scalar(
            lambda offset: min(total(replace(self, offset_rad=float(offset))), 1e12),
            bounds=(self.offset_rad - STEP_RAD, self.offset_rad + STEP_RAD),
            method="bounded",
            options={"xatol": 1e-3},
        )
        return replace(self, offset_rad=float(found.x))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return super().to_dict() | {"offset_rad": self.offset_rad}


def suspects(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Conventions of all robots and of each, then every single encoder."""
    level, N = signals.level, signals.robots
    home = np.array([0.0, 0.0, design.home_height_m])
    at_home = tuple(float(x) for x in (inverse_kinematics(home, design) if level == "joint" else home))
    for robots in teams(N):
        yield CountsFromHome(level, robots, N, (at_home[0], at_home[1], at_home[2]))
        if level == "joint":
            yield CountsFromVertical(level, robots, N, -1)
            yield CountsFromVertical(level, robots, N, 1)
    groups: tuple[Kind, ...] = ("position", "theta") if level == "joint" else ("theta",)
    for robot in range(N):
        for group in groups:
            for joint in range(3):
                for k in STEPS:
                    yield WrongZero(level, (robot,), N, group, joint, k * STEP_RAD)
