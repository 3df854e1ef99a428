"""Friction of the true machines: Coulomb and viscous, or laws of servos that depend on the load.

The laws are M1 to M6 of Duclusaud, Passault, Padois and Ly, "Extended friction models for the physics simulation of
servo actuators" (2024): the friction torque is whatever stops the joint, up to a budget that falls with the speed
(Stribeck) and grows with the torques of the motor and from outside, linearly and squared, plus a viscous part.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np

LAWS = ("M1", "M4", "M5", "M6")
COUNT = 6


@dataclass
class Law:
    """Numbers of the law of every joint, shape (J,) each.

    Attributes:
        base: Coulomb friction without load [N m].
        stribeck: additional at rest [N m].
        motor, outside: friction by torque of the motor, and from outside.
        motor_stribeck, outside_stribeck: additional at rest.
        motor_square, outside_square: of the squared torques at rest [1/(N m)], if the two work against each other.
        speed: of the Stribeck effect [rad/s].
        sharpness: its exponent.
        viscous: [N m s/rad].
        factor: on all but the viscous part; 1 without a fault.
    """

    base: np.ndarray
    stribeck: np.ndarray
    motor: np.ndarray
    outside: np.ndarray
    motor_stribeck: np.ndarray
    outside_stribeck: np.ndarray
    motor_square: np.ndarray
    outside_square: np.ndarray
    speed: np.ndarray
    sharpness: np.ndarray
    viscous: np.ndarray
    factor: np.ndarray

    @property
    def plain(self) -> bool:
        """Whether it is Coulomb and viscous friction alone."""
        return not (self.stribeck.any() or self.motor.any() or self.outside.any())

    def budget(self, motor: np.ndarray, outside: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Largest dry friction [N m], shape (..., J), at torques of motor and from outside [N m], speeds [rad/s]."""
        if self.plain:
            return np.broadcast_to(self.factor * self.base, np.shape(dq))
        slow = np.exp(-((np.abs(dq) / self.speed) ** self.sharpness))
        load = np.abs(outside * self.outside - motor * self.motor)
        load_slow = np.abs(outside * self.outside_stribeck - motor * self.motor_stribeck)
        square = np.where(
            np.abs(outside) < np.abs(motor), self.outside_square * outside**2, self.motor_square * motor**2
        ) * (outside * motor < 0.0)
        return self.factor * (self.base + load + slow * (self.stribeck + load_slow + square))

    def to_json(self) -> dict[str, list[float]]:
        """Numbers by name."""
        return {name: [float(x) for x in value] for name, value in asdict(self).items()}


def law_of(kind: str, name: str, rng: np.random.Generator) -> Law:
    """A law of a machine's joints, drawn around published magnitudes.

    Legs: Coulomb 0.15 to 0.6 N m and viscous 0.15 to 0.3 N m s/rad, as a Go2's. Servos: as the paper's repository has
    for XL330, STS3215 and STS3250.
    """

    def drawn(low: float, high: float) -> np.ndarray:
        return np.exp(rng.uniform(np.log(low), np.log(high), COUNT))

    leg = kind == "leg"
    base, viscous = (drawn(0.15, 0.6), drawn(0.15, 0.3)) if leg else (drawn(0.03, 0.08), drawn(0.03, 0.08))
    ones = {"speed", "sharpness", "factor"}
    law = Law(**{each.name: np.full(COUNT, float(each.name in ones)) for each in fields(Law)})
    law.base, law.viscous = base, viscous
    if name == "M1":
        return law
    law.base = base * 0.6
    law.stribeck = drawn(0.05, 0.2) if leg else drawn(0.005, 0.03)
    law.speed, law.sharpness = (drawn(0.15, 1.0) if leg else drawn(0.08, 0.8)), rng.uniform(1.0, 2.0, COUNT)
    most = 0.4 if leg else 1.0  # gears of quadrupeds are lighter to turn back
    law.motor, law.motor_stribeck = most * drawn(0.03, 0.1), most * drawn(0.03, 0.1)
    law.outside, law.outside_stribeck = law.motor.copy(), law.motor_stribeck.copy()
    if name in ("M5", "M6"):
        law.outside, law.outside_stribeck = most * drawn(0.03, 0.14), most * drawn(0.05, 0.25)
    if name == "M6":
        law.motor_square, law.outside_square = drawn(0.002, 0.009), drawn(0.002, 0.009)
    return law
