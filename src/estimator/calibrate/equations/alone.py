"""Robots that hold nothing: the springs move the arm alone, so that its inverse dynamics must give their torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arm.dynamics import arm_torque
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.equations.level import corrected
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Sensing
from estimator.rigid_team.slots import PHI, PHI_DDOT, PHI_DOT, STEPS, TAU

_SIGNALS = np.r_[PHI, PHI_DOT, PHI_DDOT]
_BY_UNIT = np.r_[
    AT["radius"], AT["proximal_length"], AT["rod_length"], AT["tilt"],
    AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"],
]  # fmt: skip
_UNIT_STEPS = np.concatenate([np.full(11, 1e-6), np.full(7, 1e-4)])


@dataclass(frozen=True, eq=False)
class AloneEquations:
    """Rows of one recording of unloaded arms.

    Attributes:
        rows: its signals, and how they are averaged.
        variances: of one sample in motion and of a hold's mean, shape (n, N, 9) each.
        mean: averaged readings, shape (n, N, 21).
    """

    rows: Rows
    variances: tuple[Array, Array]
    mean: Array

    @classmethod
    def of(cls, rows: Rows, sensing: Sensing) -> AloneEquations:
        """Of a recording whose sensors are known."""
        mean = rows(rows.s)
        mean[rows.moving :, :, 3:9] = 0.0
        return cls(rows, sensing.variances(rows), mean)

    def residual(self, units: ArmUnit) -> Array:
        """Spring torques minus those that move the arm, shape (n, N, 3) [N m]."""
        return self.rows(_left(corrected(self.rows.s, units), units))

    def at(self, units: ArmUnit) -> tuple[Array, Array, Array]:
        """Residual (n, N, 3), derivative by own deviations (n, N, 3, ``COUNT``), covariance (n, N, 3, 3)."""
        s = corrected(self.mean, units)
        base = _left(s, units)
        by_signals = np.zeros((*base.shape, 9))
        for k, slot in enumerate(_SIGNALS):
            moved = s.copy()
            moved[..., slot] += STEPS[slot]
            by_signals[..., k] = (_left(moved, units) - base) / STEPS[slot]
        J = np.zeros((*base.shape, COUNT))
        for place, step in zip(_BY_UNIT, _UNIT_STEPS, strict=True):
            x = units.x.copy()
            x[:, place] += step
            J[..., place] = (_left(s, ArmUnit(units.design, x)) - base) / step
        J[..., AT["phi_zero"]] = -by_signals[..., :3]
        stiff = 1.0 + units.of("stiffness_ratio")
        for k in range(3):
            J[..., k, AT["tau_zero"].start + k] = -stiff[:, k]
            J[..., k, AT["stiffness_ratio"].start + k] = s[..., TAU][..., k] / stiff[:, k]
        return self.residual(units), J, self._covariance(by_signals)

    def _covariance(self, by_signals: Array) -> Array:
        moving, held = self.variances
        n, N = moving.shape[:2]
        in_motion = (np.arange(n) < self.rows.moving)[:, None, None]
        gain = self.rows.gain
        out = np.zeros((n, N, 3, 3))
        at = np.arange(3)
        out[..., at, at] = np.where(in_motion, moving[..., 6:] * gain[0, 0], held[..., 6:])
        for joint in range(3):
            part = by_signals[..., joint::3]
            noise = moving[..., joint, None, None] * gain
            still = np.zeros((n, N, 3, 3))
            still[..., 0, 0] = held[..., joint]
            out += part @ np.where(in_motion[..., None], noise, still) @ np.swapaxes(part, -1, -2)
        return out


def _left(s: Array, units: ArmUnit) -> Array:
    return s[..., TAU] - arm_torque(s[..., PHI], s[..., PHI_DOT], s[..., PHI_DDOT], units)
