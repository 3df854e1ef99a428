"""Log of a trial: the true state of every sample, checked while the trial runs, and the signals of the sensors."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from estimator.arm.design import OmnidDesign
from estimator.arrays import Array
from mocobot_sim.control.control import ControlGains, Stability, home_phi
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.as_built import AsBuilt, SensorEffects
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex, ids_of
from mocobot_sim.trial.trajectories import RATE_HZ, Trajectory


@dataclass(frozen=True)
class SensedLog:
    """Signals of the joint sensors at the control rate, before zeros, noise and rounding."""

    rate_hz: float  # control rate [Hz]; the first row is at t = 0
    ticks: int  # rows per sample of the recording
    phi: Array  # driven angles [rad], shape (T, N, 3)
    theta: Array  # gimbal angles (z, y, x) [rad], shape (T, N, 3)
    tau: Array  # minus design stiffness times deflection, after the sensor's lag [N m], shape (T, N, 3)

    def sampled(self, channel: str, delay_s: Array) -> Array:
        """Sample a channel at the recording rate, delayed by ``delay_s`` [s] for each robot.

        Delays that are not whole ticks use a cubic spline through the rows. Outside the trial the end values hold.

        Args:
            channel: ``phi``, ``theta`` or ``tau``.
            delay_s: delays [s], shape (N,).

        Returns:
            Samples, shape (Q, N, 3).
        """
        values = getattr(self, channel)
        rows = values[:: self.ticks].copy()
        clock = np.arange(len(values)) / self.rate_hz
        for robot in np.flatnonzero(delay_s):
            at = np.clip(clock[:: self.ticks] - delay_s[robot], clock[0], clock[-1])
            rows[:, robot] = CubicSpline(clock, values[:, robot])(at)
        return rows


@dataclass(frozen=True)
class TrialLog:
    """True motion and torques of a trial at ``RATE_HZ``; only ``sensed`` holds signals of sensors.

    All quantities of one row belong to one instant.

    Attributes:
        trial: kind of trajectory.
        time: [s], shape (Q,).
        phi: driven angles [rad], shape (Q, N, 3).
        theta: gimbal angles (z, y, x) [rad], shape (Q, N, 3).
        tau: true torque of the springs on the proximal links, positive if it raises them [N m], shape (Q, N, 3).
        ref_b: commanded wrist positions in {b} [m], shape (Q, N, 3).
        p_W1: origin of {1} in the world [m], shape (Q, 3).
        R_W1: orientation of {1} in the world, shape (Q, 3, 3); {1} is robot 1's flange if there is no payload.
        feed_forward: feed-forward force of the controller at the end, in {b} [N], shape (N, 3).
        gains: control gains.
        units: how each robot deviates from the design, N entries.
        sensors: timing faults of the sensors.
        sensed: signals of the joint sensors at the control rate.
        rod_error_m: largest distance between a rod's tip and its platform joint [m].
        weld_error_m: largest distance between a flange and its grasp [m].
        weld_error_rad: largest angle between a flange and its grasp [rad].
        stability: least damped mode of the control loop; None if bases drove or other actors took part.
        joint: position of the joint of a payload of two bodies [rad or m], shape (Q,); None for a rigid payload.
    """

    trial: str
    time: Array
    phi: Array
    theta: Array
    tau: Array
    ref_b: Array
    p_W1: Array
    R_W1: Array
    feed_forward: Array
    gains: ControlGains
    units: tuple[AsBuilt, ...]
    sensors: SensorEffects
    sensed: SensedLog
    rod_error_m: float
    weld_error_m: float
    weld_error_rad: float
    stability: Stability | None
    joint: Array | None = None

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.phi.shape[1]

    def payload_rotation(self) -> Array:
        """Rotation vector of the payload since the first sample, in the axes of {1} at that sample [rad], (Q, 3)."""
        return (Rotation.from_matrix(self.R_W1[0]).inv() * Rotation.from_matrix(self.R_W1)).as_rotvec()


# Largest gap of a rod, and largest gap and angle of a weld, in a valid trial. Chosen.
ROD_LIMIT_M = 0.02e-3
WELD_LIMIT_M = 0.01e-3
WELD_LIMIT_RAD = np.deg2rad(0.001)


class Rows:
    """Records the state of a trial, one row per sample of the recording.

    For each sample, call ``before_step``, step MuJoCo, then call ``after_step``.

    Args:
        model, data, index: model, data and addresses of the trial.
        samples: number of samples Q.
        slack_m: allowed gap of each grasp beyond the tolerance of a weld [m], N entries; empty for none.
        slack_rad: allowed angle of each grasp beyond the tolerance of a weld [rad], N entries; empty for none.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, samples: int,
        slack_m: tuple[float, ...] = (), slack_rad: tuple[float, ...] = (),
    ) -> None:  # fmt: skip
        self.model, self.data, self.index = model, data, index
        robots = index.robots
        self.weld_limit_m = WELD_LIMIT_M + np.array(slack_m or (0.0,) * robots)
        self.weld_limit_rad = WELD_LIMIT_RAD + np.array(slack_rad or (0.0,) * robots)
        ends = (
            ids_of(model.site, robots, [name.format(k) for k in (1, 2, 3)])
            for name in ("rod{}_tip", "platform{}")
        )
        self.sites = np.concatenate([index.grasp_site, index.payload_site, *(end.ravel() for end in ends)])
        self.welded = self.sites[: 2 * robots]
        # Keep views of MuJoCo's arrays: attribute access takes as long as copying the data.
        self._state, self._spring = data.qpos, data.qfrc_spring
        self._xpos, self._xmat = data.site_xpos, data.site_xmat
        self.qpos = np.empty((samples, model.nq))
        self.spring_force = np.empty((samples, model.nv))
        self.site_xpos = np.empty((samples, len(self.sites), 3))
        self.site_xmat = np.empty((samples, 2 * robots, 9))

    def before_step(self, sample: int) -> None:
        """Record the state before a step."""
        self.qpos[sample] = self._state

    def after_step(self, sample: int) -> None:
        """Record the forces and frames that the step has evaluated at the state before it."""
        self.spring_force[sample] = self._spring
        # All indices are valid; mode "clip" lets numpy write to the output without a buffer.
        self._xpos.take(self.sites, 0, self.site_xpos[sample], "clip")
        self._xmat.take(self.welded, 0, self.site_xmat[sample], "clip")

    def phi(self, rows: slice, design: OmnidDesign) -> Array:
        """Driven angles [rad], shape (rows, N, 3)."""
        q = self.qpos[rows]
        return home_phi(design) + q[:, self.index.motor_qpos] + q[:, self.index.spring_qpos]

    def theta(self, rows: slice) -> Array:
        """Gimbal angles (z, y, x) [rad], shape (rows, N, 3)."""
        return self.qpos[rows][:, self.index.gimbal_qpos]

    def tau(self, rows: slice) -> Array:
        """Torques of the springs [N m], shape (rows, N, 3)."""
        return self.spring_force[rows][:, self.index.spring_dof]

    def errors(self, rows: slice) -> tuple[Array, Array, Array]:
        """Gaps of rods (rows, 3 N) and welds (rows, N) [m], and angles of welds (rows, N) [rad]."""
        n = self.index.robots
        xpos, xmat = self.site_xpos[rows], self.site_xmat[rows].reshape(-1, 2 * n, 3, 3)
        rod = np.linalg.norm(xpos[:, 2 * n : 5 * n] - xpos[:, 5 * n :], axis=-1)
        weld = np.linalg.norm(xpos[:, :n] - xpos[:, n : 2 * n], axis=-1)
        # |R1 - R2|_F = 2 sqrt(2) sin(angle / 2) is accurate for small angles, where arccos is not.
        angle = np.linalg.norm(xmat[:, :n] - xmat[:, n:], axis=(-2, -1)) / np.sqrt(2.0)
        return rod, weld, angle

    def check(self, start: int, stop: int, design: OmnidDesign) -> None:
        """Check the rows from ``start`` to ``stop``.

        Raises:
            TrialError: MuJoCo warned, a value is not finite, a joint or torque is out of range, or a loop opened.
        """
        rows = slice(start, stop)
        when = np.arange(start, stop) / RATE_HZ
        warned = [mujoco.mjtWarning(k).name for k in np.flatnonzero(self.data.warning.number)]
        if warned:
            raise TrialError(f"MuJoCo warned {warned[0]} before t = {when[-1]:.2f} s")
        if not np.isfinite(self.qpos[rows]).all() or not np.isfinite(self.data.qvel).all():
            raise TrialError(f"the state is not finite before t = {when[-1]:.2f} s")
        phi, theta, tau = self.phi(rows, design), self.theta(rows), self.tau(rows)
        rod, weld, angle = self.errors(rows)
        _limit("phi", phi, design.phi_min_rad, design.phi_max_rad, "rad", when)
        _limit("theta (z, y, x)", theta, -design.gimbal_limit_rad, design.gimbal_limit_rad, "rad", when)
        _limit("SEA torque", tau, -design.torque_limit_Nm, design.torque_limit_Nm, "N m", when)
        _limit("rod error", rod.reshape(len(rod), -1, 3), 0.0, ROD_LIMIT_M, "m", when)
        for i, (limit_m, limit_rad) in enumerate(zip(self.weld_limit_m, self.weld_limit_rad, strict=True)):
            _limit("weld error", weld[:, i : i + 1, None], 0.0, limit_m, "m", when, robot=i)
            _limit("weld angle", angle[:, i : i + 1, None], 0.0, limit_rad, "rad", when, robot=i)

    def finish(
        self,
        trajectory: Trajectory,
        feed_forward: Array,
        gains: ControlGains,
        scene: TeamScene,
        sensed: SensedLog,
        stability: Stability | None,
    ) -> TrialLog:
        """Make the log of the whole trial from all rows."""
        rows = slice(None)
        rod, weld, angle = self.errors(rows)
        return TrialLog(
            trial=trajectory.trial,
            time=np.arange(len(self.qpos)) / RATE_HZ,
            phi=self.phi(rows, omnid_design()),
            theta=self.theta(rows),
            tau=self.tau(rows),
            ref_b=trajectory.ref_b,
            p_W1=self.site_xpos[:, 0].copy(),
            R_W1=self.site_xmat[:, 0].reshape(-1, 3, 3).copy(),
            feed_forward=feed_forward,
            gains=gains,
            units=scene.units,
            sensors=scene.sensors,
            sensed=sensed,
            rod_error_m=float(rod.max()),
            weld_error_m=float(weld.max()),
            weld_error_rad=float(angle.max()),
            stability=stability,
            joint=self._joint(),
        )

    def _joint(self) -> Array | None:
        joints = self.model.dof_jntid[self.index.payload_dof]
        return self.qpos[:, self.model.jnt_qposadr[joints[0]]] if len(joints) else None


def _limit(name: str, values: Array, low: float, high: float, unit: str, when: Array, robot: int = 0) -> None:
    """Raise ``TrialError`` for the first value outside [low, high]; values have shape (rows, N, k).

    The first robot of the values has the index ``robot``, counted from 0.
    """
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        row, i, k = (int(axis[0]) for axis in np.nonzero(bad))
        raise TrialError(
            f"omnid{robot + i + 1}: {name} {k + 1} is {values[row, i, k]:.4g} {unit} at t = {when[row]:.2f} s; "
            f"the allowed range is {low:.4g} .. {high:.4g} {unit}"
        )
