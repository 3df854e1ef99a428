"""The log of a trial: what is kept of every sample, checked as it comes, and what the sensors see."""

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
    """Joint angles and torque readings at the control rate, before zeros, noise and rounding."""

    rate_hz: float  # control rate [Hz]; the first row is at t = 0
    ticks: int  # rows per sample of the recording
    phi: Array  # driven angles [rad], shape (T, N, 3)
    theta: Array  # gimbal angles (z, y, x) [rad], shape (T, N, 3)
    tau: Array  # torque readings, minus design stiffness times deflection, through the sensor's lag [N m], (T, N, 3)

    def sampled(self, channel: str, delay_s: Array) -> Array:
        """A channel at the recording's instants, each robot's later by its delay [s], shape (Q, N, 3).

        Delays, shape (N,), need not be whole ticks: a cubic spline runs through the rows. Before the first and after
        the last row the end values hold.
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
    """What truly happened, at ``RATE_HZ``; nothing here has passed a sensor.

    All quantities of one row belong to one instant.

    Attributes:
        trial: kind of trajectory.
        time: [s], shape (Q,).
        phi: driven angles [rad], shape (Q, N, 3).
        theta: gimbal angles (z, y, x) [rad], shape (Q, N, 3).
        tau: true torque of the springs on the proximal links, positive raising them [N m], shape (Q, N, 3).
        ref_b: commanded wrist positions in {b} [m], shape (Q, N, 3).
        p_W1: origin of {1} in the world [m], shape (Q, 3).
        R_W1: orientation of {1} (the payload, or robot 1's flange that holds nothing) in the world, shape (Q, 3, 3).
        feed_forward: the controller's frozen load force in {b} [N], shape (N, 3).
        gains: control gains.
        units: how each robot deviates from the design, N entries.
        sensors: timing faults of the sensors.
        sensed: what the joint sensors see, at the control rate.
        rod_error_m: largest distance between a rod's tip and its platform joint [m].
        weld_error_m: largest distance between a flange and its grasp [m].
        weld_error_rad: largest angle between a flange and its grasp [rad].
        stability: whether the control was stable; None where bases drove or others acted on the arms.
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

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.phi.shape[1]

    def payload_rotation(self) -> Array:
        """Rotation vector of the payload from its pose at the first sample, in {1} then [rad], shape (Q, 3)."""
        return (Rotation.from_matrix(self.R_W1[0]).inv() * Rotation.from_matrix(self.R_W1)).as_rotvec()


ROD_LIMIT_M = 0.02e-3
WELD_LIMIT_M = 0.01e-3
WELD_LIMIT_RAD = np.deg2rad(0.001)


class Rows:
    """Q rows of N robots, one per sample of the recording; ``before_step`` and ``after_step`` write them in turn.

    Args:
        model, data, index: the trial's.
        samples: Q.
        slack_m: by how much each grasp may open beyond a weld's softness [m], N entries; empty for none.
        slack_rad: by how much it may turn [rad], likewise.
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
        # Views of MuJoCo's memory, which stays where it is: to ask for them takes as long as to copy them.
        self._state, self._spring = data.qpos, data.qfrc_spring
        self._xpos, self._xmat = data.site_xpos, data.site_xmat
        self.qpos = np.empty((samples, model.nq))
        self.spring_force = np.empty((samples, model.nv))
        self.site_xpos = np.empty((samples, len(self.sites), 3))
        self.site_xmat = np.empty((samples, 2 * robots, 9))

    def before_step(self, sample: int) -> None:
        """Keep the state that a step starts from."""
        self.qpos[sample] = self._state

    def after_step(self, sample: int) -> None:
        """Keep the forces and frames that the step evaluated at that state."""
        self.spring_force[sample] = self._spring
        # "clip" changes no index, and lets numpy write where it shall.
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
        """Opening of rods (rows, 3 N) and welds (rows, N) [m], and angle of welds (rows, N) [rad]."""
        n = self.index.robots
        xpos, xmat = self.site_xpos[rows], self.site_xmat[rows].reshape(-1, 2 * n, 3, 3)
        rod = np.linalg.norm(xpos[:, 2 * n : 5 * n] - xpos[:, 5 * n :], axis=-1)
        weld = np.linalg.norm(xpos[:, :n] - xpos[:, n : 2 * n], axis=-1)
        # |R1 - R2|_F = 2 sqrt(2) sin(angle / 2): exact for the tiny angles here, where arccos is not.
        angle = np.linalg.norm(xmat[:, :n] - xmat[:, n:], axis=(-2, -1)) / np.sqrt(2.0)
        return rod, weld, angle

    def check(self, start: int, stop: int, design: OmnidDesign) -> None:
        """Check the rows since the last check.

        Raises:
            TrialError: the physics cannot be trusted.
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
        """The log of the whole trial."""
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
        )


def _limit(name: str, values: Array, low: float, high: float, unit: str, when: Array, robot: int = 0) -> None:
    """Raise for the first value, shape (rows, N, k), outside [low, high]; the values' robots count from ``robot``."""
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        row, i, k = (int(axis[0]) for axis in np.nonzero(bad))
        raise TrialError(
            f"omnid{robot + i + 1}: {name} {k + 1} is {values[row, i, k]:.4g} {unit} at t = {when[row]:.2f} s; "
            f"the allowed range is {low:.4g} .. {high:.4g} {unit}"
        )
