"""Rows of loops and balance of one trial, with derivatives by the unknowns and the covariance of their noise.

Residuals and signs are those of ``estimator.rigid_team``, with the robots' deviations. The residual is evaluated at
the thinned instants and averaged into rows. Derivatives are evaluated at the rows' mean signals, which vary slowly.
These signals are first adjusted to the model (W. E. Deming, Statistical Adjustment of Data, 1943; Gauss-Helmert model
in geodesy). Without the adjustment, derivative and residual share the same noise, which biases the mass by -3.6 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from estimator.arm.delta import jacobian_of, leg_geometry, length_jacobians
from estimator.arm.dynamics import arm_torque, rate_matrix, rotation
from estimator.arm.motion import (
    BY_UNIT,
    PHI,
    PHI_DDOT,
    PHI_DOT,
    STEPS,
    TAU,
    THETA,
    ArmChanges,
    ArmData,
    yaw_matrix,
)
from estimator.arm.motion import COUNT as SLOTS
from estimator.arm.unit import AT, COUNT, ArmUnit, true_joints
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.driven import PATHS, SCALES, STATES, Drift, Driven
from estimator.calibrate.rows import Rows, Sensing
from estimator.rigid_team import (
    Bases,
    Shared,
    fusion_changes,
    fusion_with,
    needed_wrench,
    newton_euler_regressor,
    pose_error,
    robot_data,
    total_wrench,
    vee,
)
from estimator.so3 import cross, skew, times


def corrected(s: Array, units: ArmUnit) -> Array:
    """Convert sensor readings to true signals, shape (..., N, ``SLOTS``)."""
    s = s.copy()
    s[..., PHI], s[..., THETA], s[..., TAU] = true_joints(units, s[..., PHI], s[..., THETA], s[..., TAU])
    return s


_POSE = np.r_[
    AT["phi_zero"], AT["theta_zero"], AT["radius"], AT["proximal_length"], AT["rod_length"], AT["tilt"]
]
_AXES = np.eye(3)[:, :2]
_PLANAR = [3, 4, 2]  # x, y and yaw among the errors of a base
_JOLT, _SCALE = 1e-3, 1e-3  # steps of finite differences, by acceleration and by scale


def pose_derivatives(rows: Rows, units: ArmUnit, shared: Shared, bases: Bases) -> tuple[Array, Array, Array]:
    """Return derivatives of the loops' 6 (N - 1) channels in n rows.

    Returns:
        Derivatives by the robots' deviations, shape (n, 6 (N - 1), N, ``COUNT``); by ``Shared.moved``, (n, ., 6 (N -
        1) + 10); and by ``Bases.moved``, (n, ., 4 (N - 1)).
    """
    s = corrected(rows.s, units)
    R_bi, h, turn, shift = _by_unit(s, units)
    n, N = len(rows.time), h.shape[1]
    channels = 6 * (N - 1)
    by_units = np.zeros((n, channels, N, COUNT))
    by_carried = np.zeros((n, channels, channels + 10))
    by_bases = np.zeros((n, channels, 4 * (N - 1)))
    R_b1 = rows(R_bi[:, 0])
    mean_turn, mean_shift, mean_h = rows(turn), rows(shift), rows(h)
    for j in range(1, N):
        about, along = slice(6 * (j - 1), 6 * (j - 1) + 3), slice(6 * (j - 1) + 3, 6 * j)
        lever = R_bi[:, 0] @ shared.grasps.p_1i[j]
        swept = rows(np.asarray(np.cross(turn[:, 0], lever[:, :, None], axis=1), dtype=np.float64))
        by_units[:, about, 0, _POSE] = -mean_turn[:, 0]
        by_units[:, along, 0, _POSE] = -mean_shift[:, 0] - swept
        by_units[:, about, j, _POSE] = bases.R[j] @ mean_turn[:, j]
        by_units[:, along, j, _POSE] = bases.R[j] @ mean_shift[:, j]
        by_carried[:, about, about] = by_carried[:, along, along] = -R_b1
        column, turned = 4 * (j - 1), mean_h[:, j] @ bases.R[j].T
        by_bases[:, along, column : column + 3] = np.eye(3)
        by_bases[:, about.start + 2, column + 3] = 1.0
        by_bases[:, along.start, column + 3] = -turned[:, 1]
        by_bases[:, along.start + 1, column + 3] = turned[:, 0]
    return by_units, by_carried, by_bases


def _by_unit(s: Array, units: ArmUnit) -> tuple[Array, Array, Array, Array]:
    """Return R_bi, h, and their rotations and shifts per deviation, (q, N, 3, len(_POSE)), in level base frames."""
    phi, theta = s[..., PHI], s[..., THETA]
    legs = leg_geometry(phi, units)
    R_ai = rotation(theta)
    shift = np.zeros((*phi.shape, len(_POSE)))
    turn = np.zeros_like(shift)
    shift[..., :3] = -jacobian_of(legs)
    turn[..., 3:6] = -(R_ai @ rate_matrix(theta))
    for k, part in enumerate(length_jacobians(legs, phi, units)):
        shift[..., 6 + 3 * k : 9 + 3 * k] = part
    R_ba = units.R_ba
    if s.shape[-1] > SLOTS:
        R_ba = yaw_matrix(s[..., SLOTS + 2]) @ R_ba
    R_bi, h = R_ba @ R_ai, (R_ba @ legs.h[..., None])[..., 0]
    turn, shift = R_ba @ turn, R_ba @ shift
    turn[..., 15:] = _AXES
    shift[..., 15:] = np.cross(_AXES.T, h[..., None, :]).swapaxes(-1, -2)
    if s.shape[-1] > SLOTS:
        h[..., :2] += s[..., SLOTS : SLOTS + 2]
    return R_bi, h, turn, shift


# Signals with correlated noise: value, rate and acceleration of each joint; the three torques.
_CHAINS = [np.array([first + k + 3 * order for order in range(3)]) for first in (0, 9) for k in range(3)] + [
    np.arange(18, 21)
]


def covariance_of(J: Array, noise: Array) -> Array:
    """Return the covariance of the rows' residual, shape (n, C, C).

    Args:
        J: derivative of the residual by the rows' signals, shape (n, C, N, ``SLOTS``).
        noise: covariance of the signals, as from ``noise_of``.
    """
    total = np.zeros((len(J), J.shape[1], J.shape[1]))
    for robot in range(J.shape[2]):
        for joint, at in enumerate(_CHAINS):
            part = J[:, :, robot, at]
            total += part @ noise[:, robot, joint] @ np.swapaxes(part, 1, 2)
    return total


def adjustment_of(J: Array, noise: Array, covariance: Array, residual: Array) -> Array:
    """Return the likeliest change of the rows' signals that makes loops and balance zero, shape (n, N, ``SLOTS``).

    Args:
        J, noise: as for ``covariance_of``.
        covariance: result of ``covariance_of``.
        residual: residual to remove, shape (n, C).
    """
    weighed = np.linalg.solve(covariance, residual[..., None])
    out = np.zeros((len(J), J.shape[2], SLOTS))
    for robot in range(J.shape[2]):
        for joint, at in enumerate(_CHAINS):
            moved = noise[:, robot, joint] @ (np.swapaxes(J[:, :, robot, at], 1, 2) @ weighed)
            out[:, robot, at] -= moved[..., 0]
    return out


def noise_of(rows: Rows, variances: tuple[Array, Array]) -> Array:
    """Return the covariance of (value, rate, acceleration) per joint, and of the torques, (n, N, 7, 3, 3)."""
    moving, held = variances
    n, N = moving.shape[:2]
    out = np.zeros((n, N, 7, 3, 3))
    at = slice(0, rows.moving)
    out[at, :, :6] = moving[at, :, :6, None, None] * rows.gain
    out[at, :, 6, range(3), range(3)] = moving[at, :, 6:] * rows.gain[0, 0]
    at = slice(rows.moving, None)
    out[at, :, :6, 0, 0] = held[at, :, :6]
    out[at, :, 6, range(3), range(3)] = held[at, :, 6:]
    return out


class Rowed(NamedTuple):
    """Rows of one trial; C = 6 N channels, the balance's force and moment last.

    Attributes:
        residual: shape (n, C).
        by_units: derivative by every robot's deviations, shape (n, C, N, ``COUNT``).
        by_carried: derivative by ``Shared.moved``, shape (n, C, 6 (N - 1) + 10).
        by_bases: derivative by ``Bases.moved``, shape (n, C, 4 (N - 1)).
        covariance: of the residual noise for the fit: repeating errors do not average out, shape (n, C, C).
        scatter: of the residual noise as visible in the scatter of the rows, shape (n, C, C).
        adjustment: change of the rows' signals towards the model, shape (n, N, ``SLOTS``).
        driven: derivatives by errors of the bases; None for bases that stand.
    """

    residual: Array
    by_units: Array
    by_carried: Array
    by_bases: Array
    covariance: Array
    scatter: Array
    adjustment: Array
    driven: Driven | None = None


class Curvature(NamedTuple):
    """Corrections of the balance's derivatives for motion within a row; shapes as in ``Rowed``, with 6 channels."""

    by_units: Array
    by_carried: Array


@dataclass(frozen=True, eq=False)
class TrialEquations:
    """Rows of one trial as a function of the unknowns.

    Attributes:
        rows: signals of the trial and their averaging.
        variances: for the fit, of one sample in motion and of a hold's mean, shape (n, N, 9) each.
        shown: the same, as visible in the scatter of the rows.
        mean: averaged readings, shape (n, N, ``SLOTS``).
        held: whether to omit derivatives by the robots' lengths and masses (set to 0).
        first: whether the rows are the first of the trial.
        drift: standard deviations of the errors of driving bases.
    """

    rows: Rows
    variances: tuple[Array, Array]
    shown: tuple[Array, Array]
    mean: Array
    held: bool = False
    first: bool = True
    drift: Drift = field(default_factory=Drift)

    @classmethod
    def of(
        cls,
        rows: Rows,
        sensing: Sensing,
        *,
        held: bool = False,
        first: bool = True,
        drift: Drift | None = None,
    ) -> TrialEquations:
        """Make the equations of a trial from its rows and the resolution of its sensors."""
        mean = rows(rows.s)
        # Rates in a hold are noise.
        mean[rows.moving :, :, 3:9] = mean[rows.moving :, :, 12:18] = 0.0
        mean[rows.moving :, :, SLOTS + 3 :] = 0.0
        shown = sensing.variances(replace(rows, repeats=1.0))
        return cls(rows, sensing.variances(rows), shown, mean, held, first, drift or Drift())

    def residual(self, units: ArmUnit, shared: Shared, bases: Bases, wrong: Array | None = None) -> Array:
        """Return the rows of the residual, shape (n, C); ``wrong`` are errors of the bases' signals, (q, N, 9)."""
        s = corrected(self.rows.s, units)
        if wrong is not None:
            s[..., SLOTS:] += wrong
        data = robot_data(s, units)
        pose = pose_error(data.R_bi, data.h, shared, bases)
        force, moment = total_wrench(data.wrench, shared.grasps)
        needed = _motion(data, units, shared).regressor(units) @ shared.pi
        balance = np.concatenate([force, moment], axis=1) - needed
        return self.rows(np.concatenate([pose, balance], axis=1))

    def curvature(
        self, units: ArmUnit, shared: Shared, bases: Bases, before: Curvature | None = None
    ) -> Curvature:
        """Return the row average of the balance's derivatives minus their value at the mean signals.

        Derivatives by the payload are averaged over all instants. If the payload turns about one axis, products of
        rates determine moments of inertia about the other axes, and mean rates lose them. Holds get no correction,
        because their rates are noise. Derivatives by the robots are slower to compute and vary less, so ``before``
        supplies them if given.
        """
        s, mean = corrected(self.rows.s, units), corrected(self.mean, units)
        fine, coarse = (_by_carried(robot_data(x, units), units, shared)[:, -6:] for x in (s, mean))
        by_carried = self.rows(fine) - coarse
        by_carried[self.rows.moving :] = 0.0
        if before is not None:
            return Curvature(before.by_units, by_carried)
        by_units = np.zeros((len(mean), 6, *units.x.shape))
        if not self.held:
            every = rules.CURVATURE_EVERY
            fine, coarse = (
                _by_robots(x, units, shared, bases)[1][:, -6:]
                for x in (corrected(self.rows.s[::every], units), mean)
            )
            # Nearest-neighbour interpolation.
            near = np.minimum((np.arange(len(s)) + every // 2) // every, len(fine) - 1)
            by_units = self.rows(fine[near]) - coarse
            by_units[self.rows.moving :] = 0.0
        return Curvature(by_units, by_carried)

    def at(
        self,
        units: ArmUnit,
        shared: Shared,
        bases: Bases,
        adjustment: Array | None = None,
        curvature: Curvature | None = None,
        wrong: tuple[Array, Array] | None = None,
    ) -> Rowed:
        """Evaluate residual, derivatives and covariances at some unknowns.

        Args:
            units, shared, bases: the unknowns.
            adjustment: signal adjustment from nearby unknowns; None at first.
            curvature: curvature of the balance's derivatives from nearby unknowns; None to omit it.
            wrong: errors of driving bases from nearby unknowns, as in ``Eliminated``; None at first. The residual
                returned is that of bases without errors, by the derivatives there.
        """
        s = corrected(self.mean, units)
        if adjustment is not None:
            s[..., :SLOTS] += adjustment
        path = None if wrong is None else self._path(*wrong)
        residual = self.residual(units, shared, bases, path)
        by_signals, by_units = _by_robots(s, units, shared, bases, held=self.held)
        by_carried = _by_carried(robot_data(s, units), units, shared)
        by_bases = np.zeros((*residual.shape, 4 * (shared.grasps.robots - 1)))
        # Loops barely determine a common scale of all lengths; a relative error of 1e-3 in one derivative would hide
        # it. So derivatives of loops are averaged exactly.
        loops = slice(0, residual.shape[1] - 6)
        by_units[:, loops], by_carried[:, loops], by_bases[:, loops] = pose_derivatives(
            self.rows, units, shared, bases
        )
        if curvature is not None:
            by_units[:, -6:] += curvature.by_units
            by_carried[:, -6:] += curvature.by_carried
        noise = noise_of(self.rows, self.variances)
        covariance = scatter = covariance_of(by_signals, noise)
        if np.any(np.asarray(self.rows.repeats) > 1.0):
            scatter = covariance_of(by_signals, noise_of(self.rows, self.shown))
        driven = self._driven(s, units, shared, bases) if self.rows.driven else None
        left = residual
        if driven is not None and wrong is not None:
            residual = residual - self._explained(driven, wrong)
            left = (
                residual + np.einsum("nck,nk->nc", driven.by_states, wrong[0]) + driven.by_scales @ wrong[1]
            )
        noisy = covariance if driven is None else driven.with_noise(covariance, self.drift)
        adjusted = adjustment_of(by_signals, noise, noisy, left)
        return Rowed(residual, by_units, by_carried, by_bases, covariance, scatter, adjusted, driven)

    def _explained(self, driven: Driven, wrong: tuple[Array, Array]) -> Array:
        """Return the part of the residual that errors of the bases' path explain, shape (n, C)."""
        known = np.zeros((*self.rows.s.shape[:2], STATES))
        known[..., _PLANAR] = self._path(wrong[0], 0.0 * wrong[1])[..., :3]
        walked = self.rows(known).reshape(len(wrong[0]), -1)
        path = wrong[1].reshape(-1, SCALES) * (np.arange(SCALES) < PATHS)
        return np.einsum("nck,nk->nc", driven.by_states, walked) + driven.by_scales @ path.ravel()

    @property
    def _scaled(self) -> Array:
        assert self.rows.scaled is not None
        return self.rows.scaled

    def _path(self, states: Array, scales: Array) -> Array:
        """Return errors of the bases' signals at all instants, shape (q, N, 9), from those of rows and of scale."""
        order = np.argsort(self.rows.time)
        planar = states.reshape(len(states), -1, STATES)[..., _PLANAR]
        at = np.arange(len(self.rows.s), dtype=float)
        middle, out = self.rows(at)[order], np.zeros((*self.rows.s.shape[:2], 9))
        for i, k in np.ndindex(planar.shape[1:]):
            out[:, i, k] = np.interp(at, middle, planar[order, i, k])
        return out + np.einsum(
            "qnak,na->qnk", self._scaled[:, :, :PATHS], scales.reshape(-1, SCALES)[:, :PATHS]
        )

    def _driven(self, s: Array, units: ArmUnit, shared: Shared, bases: Bases) -> Driven:
        """Return derivatives by errors of the bases at mean signals s."""
        n, N = s.shape[:2]
        data = robot_data(s, units)
        motion = _motion(data, units, shared)
        by_states, by_jolts = np.zeros((n, 6 * N, N, STATES)), np.zeros((n, 6, N, 3))
        by_scales = np.zeros((n, 6 * N, N, SCALES))
        here, before = self._balance(s, units, shared), self.residual(units, shared, bases)
        for i in range(N):
            arm = data.h[:, i] - s[:, i, SLOTS : SLOTS + 3] * [1.0, 1.0, 0.0]
            lever = arm - [0.0, 0.0, rules.FLOOR_M]
            turned = skew(np.eye(3))[:, None] @ data.R_bi[:, i]
            apart = np.cross(np.eye(3)[:, None], lever)
            R = np.concatenate([turned, np.zeros_like(turned)])
            h = np.concatenate([apart, np.broadcast_to(np.eye(3)[:, None], apart.shape)])
            none, weight = np.zeros((*h.shape[:2], 6)), np.zeros((*h.shape[:2], 6))
            for k, (along, sign) in enumerate(((1, 1.0), (0, -1.0))):  # weight of the arm in a tilted frame
                pulled = s.copy()
                pulled[:, i, SLOTS + 6 + along] += sign * units.gravity_mps2
                weight[k] = robot_data(pulled, units).wrench[:, i] - data.wrench[:, i]
            of_base = ArmData(R, h, none, none, weight)
            changed = _chain(i, of_base, data.R_bi[:, i], motion, shared, bases, units.gravity_mps2)
            by_states[:, :, i] = np.moveaxis(changed, 0, -1)
            ahead = s[:, i, SLOTS + 6 : SLOTS + 9] * [1.0, 1.0, 0.0]
            load = -times(data.R_bi[:, i], data.wrench[:, i, 3:])
            for k, tilt in enumerate((np.cross([0.0, 0.0, 1.0], ahead), cross(arm, load) * [1.0, 1.0, 0.0])):
                by_scales[:, :, i, PATHS + k] += np.einsum("nck,nk->nc", by_states[:, :, i, :3], tilt)
            for k in range(3):
                jolted = s.copy()
                jolted[:, i, SLOTS + 6 + k] += _JOLT
                by_jolts[:, :, i, k] = (self._balance(jolted, units, shared) - here) / _JOLT
            for k in range(SCALES):
                path = np.zeros((*self.rows.s.shape[:2], 9))
                path[:, i] = _SCALE * self._scaled[:, i, k]
                change = (self.residual(units, shared, bases, path) - before) / _SCALE
                if k >= PATHS:  # a tilt also moves the wrist, whose acceleration enters the balance
                    change[:, :-6] = 0.0
                by_scales[:, :, i, k] += change * (lever[:, None, 2] if k == PATHS else 1.0)
        by_jolts[self.rows.moving :] = 0.0
        order = np.argsort(self.rows.time)
        place, moved = s[order][..., SLOTS : SLOTS + 2], np.empty((n, N, 2))
        moved[order] = np.diff(place, axis=0, prepend=place[:1])
        by_states, by_scales, by_jolts = (
            x.reshape(*x.shape[:2], -1) for x in (by_states, by_scales, by_jolts)
        )
        return Driven(by_states, by_scales, by_jolts, moved, self.rows.time, self.first)

    def _balance(self, s: Array, units: ArmUnit, shared: Shared) -> Array:
        data = robot_data(s, units)
        needed = _motion(data, units, shared).regressor(units) @ shared.pi
        return np.concatenate(total_wrench(data.wrench, shared.grasps), axis=1) - needed


class _Motion(NamedTuple):
    """Motion of the payload in {1}.

    Attributes:
        twist, twist_dot: twist and its rate, shape (Q, 6) each.
        up: direction against gravity, the mean over the robots, shape (Q, 3).
        length: length of the sum of the robots' directions, shape (Q, 1).
        G: V_1 = G [V_1; ...; V_N], shape (6, 6 N).
    """

    twist: Array
    twist_dot: Array
    up: Array
    length: Array
    G: Array

    def regressor(self, units: ArmUnit) -> Array:
        """Return the regressor of the wrench by the ten inertial parameters, shape (Q, 6, 10)."""
        omega = self.twist[:, :3]
        specific = self.twist_dot[:, 3:] + cross(omega, self.twist[:, 3:]) + units.gravity_mps2 * self.up
        return newton_euler_regressor(omega, self.twist_dot[:, :3], specific)


def _ratio(units: ArmUnit) -> float:
    """Return the weight of linear residuals for equal encoder noise, which moves the wrist through the driven links."""
    return 1.0 / units.design.proximal_length_m


def _motion(data: ArmData, units: ArmUnit, shared: Shared) -> _Motion:
    G, Q = fusion_with(shared.grasps, _ratio(units)), len(data.h)
    up = np.einsum("iab,qib->qa", shared.grasps.R_1i, data.R_bi[..., 2, :])
    length = np.linalg.norm(up, axis=1, keepdims=True)
    twist, twist_dot = (part.reshape(Q, -1) @ G.T for part in (data.twist, data.twist_dot))
    return _Motion(twist, twist_dot, up / length, length, G)


def _by_robots(
    s: Array, units: ArmUnit, shared: Shared, bases: Bases, *, held: bool = False
) -> tuple[Array, Array]:
    """Return derivatives of the residual by signals (n, C, N, ``SLOTS``) and by units (n, C, N, ``COUNT``)."""
    n, N = s.shape[:2]
    data = robot_data(s, units)
    motion = _motion(data, units, shared)
    by_signals, by_units = np.zeros((n, 6 * N, N, SLOTS)), np.zeros((n, 6 * N, N, COUNT))
    for i in range(N):
        unit = ArmUnit(units.design, units.x[i])
        arm, turn = ArmChanges(s[:, i], unit), None
        if s.shape[-1] > SLOTS:
            turn = yaw_matrix(s[:, i, SLOTS + 2])
        parts = [(np.arange(SLOTS), by_signals, arm.by_signals())]
        parts += [] if held else [(BY_UNIT, by_units, arm.by_unit())]
        for places, changed, d in parts:
            if turn is not None:
                d = d._replace(R_bi=turn @ d.R_bi, h=times(turn, d.h))
            part = _chain(i, d, data.R_bi[:, i], motion, shared, bases, units.gravity_mps2)
            changed[:, :, i, places] = np.moveaxis(part, 0, -1)
        by_units[:, :, i, AT["phi_zero"]] = -by_signals[:, :, i, PHI]
        by_units[:, :, i, AT["theta_zero"]] = -by_signals[:, :, i, THETA]
        of_tau, stiff = by_signals[:, :, i, TAU], 1.0 + unit.of("stiffness_ratio")
        by_units[:, :, i, AT["tau_zero"]] = -of_tau * stiff
        by_units[:, :, i, AT["stiffness_ratio"]] = of_tau * (s[:, i, TAU] / stiff)[:, None]
    return by_signals, by_units


def _chain(
    i: int, d: ArmData, R_bi: Array, motion: _Motion, shared: Shared, bases: Bases, gravity: float
) -> Array:
    """Return the changes of the residual, (K, n, C), due to changes d of robot i's data, (K, n, ...)."""
    grasps = shared.grasps
    out = np.zeros((*d.h.shape[:2], 6 * grasps.robots))
    turn = vee(d.R_bi @ np.swapaxes(R_bi, -1, -2))
    for j in range(1, grasps.robots):
        at = 6 * (j - 1)
        if i == 0:
            out[..., at : at + 3] = -turn
            out[..., at + 3 : at + 6] = -d.h - d.R_bi @ grasps.p_1i[j]
        elif i == j:
            out[..., at : at + 3] = turn @ bases.R[j].T
            out[..., at + 3 : at + 6] = d.h @ bases.R[j].T
    own, up = motion.G[:, 6 * i : 6 * i + 6], motion.up
    d_up = d.R_bi[..., 2, :] @ grasps.R_1i[i].T
    d_up = (d_up - np.sum(d_up * up, axis=-1, keepdims=True) * up) / motion.length
    needed = needed_wrench(motion.twist, d.twist @ own.T, d.twist_dot @ own.T, d_up * gravity, shared.pi)
    d_force, d_moment = d.wrench[..., 3:] @ grasps.R_1i[i].T, d.wrench[..., :3] @ grasps.R_1i[i].T
    d_moment = d_moment + cross(grasps.p_1i[i], d_force)
    out[..., -6:] = np.concatenate([d_force - needed[0], d_moment - needed[1]], axis=-1)
    return out


def _by_carried(data: ArmData, units: ArmUnit, shared: Shared) -> Array:
    """Return the derivative of the balance by ``Shared.moved``, shape (n, C, 6 (N - 1) + 10); zero for the loops."""
    motion = _motion(data, units, shared)
    n, N = data.h.shape[:2]
    grasped = 6 * (N - 1)
    out = np.zeros((n, 6 * N, grasped + 10))
    d = fusion_changes(data.twist, data.twist_dot, data.R_bi, data.wrench, shared.grasps, _ratio(units))
    needed = needed_wrench(motion.twist, d.twist, d.twist_dot, units.gravity_mps2 * d.up, shared.pi)
    out[:, -6:-3, :grasped] = np.moveaxis(d.force - needed[0], 0, -1)
    out[:, -3:, :grasped] = np.moveaxis(d.moment - needed[1], 0, -1)
    out[:, -6:, grasped:] = -motion.regressor(units)
    return out


_SIGNALS = np.r_[PHI, PHI_DOT, PHI_DDOT]
_BY_UNIT = np.r_[
    AT["radius"], AT["proximal_length"], AT["rod_length"], AT["tilt"],
    AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"],
]  # fmt: skip
_UNIT_STEPS = np.concatenate([np.full(11, 1e-6), np.full(7, 1e-4)])


@dataclass(frozen=True, eq=False)
class AloneEquations:
    """Rows of one recording of unloaded arms, whose inverse dynamics must equal the spring torques.

    Attributes:
        rows: signals of the recording and their averaging.
        variances: of one sample in motion and of a hold's mean, shape (n, N, 9) each.
        mean: averaged readings, shape (n, N, 21).
    """

    rows: Rows
    variances: tuple[Array, Array]
    mean: Array

    @classmethod
    def of(cls, rows: Rows, sensing: Sensing) -> AloneEquations:
        """Make the equations of a recording from its rows and the resolution of its sensors."""
        mean = rows(rows.s)
        mean[rows.moving :, :, 3:9] = 0.0
        return cls(rows, sensing.variances(rows), mean)

    def residual(self, units: ArmUnit) -> Array:
        """Return spring torques minus the torques that move the arm, shape (n, N, 3) [N m]."""
        return self.rows(_left(corrected(self.rows.s, units), units))

    def at(self, units: ArmUnit) -> tuple[Array, Array, Array]:
        """Return residual (n, N, 3), derivative by own deviations (n, N, 3, ``COUNT``), covariance (n, N, 3, 3)."""
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
