"""Run one trial: physics and control at 1 kHz, logged at 100 Hz, checked for everything that can go wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.arm.design import OmnidDesign
from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains, TeamController, home_phi
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.actors import Actor, Stage
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.sensed import SensedLog
from mocobot_sim.trial.trajectories import RATE_HZ, Trajectory
from mocobot_sim.trial.trial_log import TrialLog as TrialLog

Array = NDArray[np.float64]

ROD_LIMIT_M = 0.02e-3
WELD_LIMIT_M = 0.01e-3
WELD_LIMIT_RAD = np.deg2rad(0.001)


def run_trial(
    scene: TeamScene,
    trajectory: Trajectory,
    gains: ControlGains | None = None,
    progress: Callable[[int], object] | None = None,
    *,
    trial_number: int | None = None,
    feed_forward: Array | None = None,
    timestep_s: float | None = None,
    actors: Sequence[Actor] = (),
) -> TrialLog:
    """Simulate one trial in closed loop.

    Args:
        scene: the team; its controllers misread what ``scene.units`` says.
        trajectory: commands.
        gains: control gains; None for the defaults.
        progress: called with the number of samples done since the last call.
        trial_number: which trial this is, from 1: the scene's pushes for other trials do not act; None lets all act.
        feed_forward: F_ff of every robot in its {b} [N], shape (N, 3), held from the start; None to take it up.
        timestep_s: integration step [s]; None for the scene's.
        actors: what else acts: bases that drive, a person's hand.

    Raises:
        TrialError: a constraint opens too far, a value is not finite, MuJoCo warns, or a joint or spring
            leaves its range.
        InputError: the team cannot be assembled, the trajectory is for another number of robots or leaves
            the workspace, or the control rate does not divide into whole steps.
    """
    _check_commands(scene, trajectory)
    gains = gains or ControlGains()
    model = scene.compile()
    if timestep_s is not None:
        model.opt.timestep = timestep_s
    data = mujoco.MjData(model)
    index = TeamIndex.of(model)
    design = omnid_design()
    assemble_at_home(scene, model, data, index)
    ticks = _whole("control rate over recording rate", gains.rate_hz / RATE_HZ)
    substeps = _whole("control period over time step", 1.0 / (gains.rate_hz * model.opt.timestep))
    ref, ref_dot = between_commands(trajectory.ref_b, ticks)
    sensed = np.empty((len(ref), index.robots, 3, 3))
    controller = TeamController(index, design, gains, data, scene.units, scene.sensors, feed_forward, sensed)
    log = _Buffers(model, data, index, len(trajectory.ref_b), scene.grasp_slack_m)
    pushes = [push for push in scene.pushes if trial_number in (None, push.trial)]
    for actor in actors:
        actor.start(Stage(model, data, index, controller, gains.rate_hz, ticks, len(ref)))
    R_Wb1 = scene.mounts.rotation[0].as_matrix()
    reported, last = 0, len(trajectory.ref_b) - 1
    for sample in range(last + 1):
        for tick in range(sample * ticks, (sample + 1) * ticks):
            if pushes or actors:
                data.xfrc_applied[index.payload_body] = 0.0
            for actor in actors:
                actor.act(tick)
            controller.update(ref[tick], ref_dot[tick])
            for push in pushes:
                push.act(model, data, index.payload_body, R_Wb1)
            if tick == sample * ticks:
                # A step first evaluates forces and frames at the state it starts from: one instant for all.
                log.before_step(sample)
                mujoco.mj_step(model, data)
                log.after_step(sample)
                remaining = substeps - 1
            else:
                remaining = substeps
            if remaining:
                mujoco.mj_step(model, data, nstep=remaining)
        if sample % 100 == 99 or sample == last:
            log.check(reported, sample + 1, design)
            if progress:
                progress(sample + 1 - reported)
            reported = sample + 1
    phi, theta, tau = (np.ascontiguousarray(sensed[:, :, k]) for k in range(3))
    return log.finish(
        trajectory, controller.feed_forward, gains, scene, SensedLog(gains.rate_hz, ticks, phi, theta, tau)
    )


def _whole(name: str, ratio: float) -> int:
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise InputError(f"the {name} is {ratio:.4g}; it must be a whole number of at least 1")
    return round(ratio)


def between_commands(ref_b: Array, ticks: int) -> tuple[Array, Array]:
    """Commands at every control tick: the cubic spline through the recorded ones, at rest at both ends.

    Straight lines between commands would jump in velocity at every sample; the ripple this causes is locked to
    the sampling, so it does not average out but aliases into the torques (up to 0.12 % on inertia).

    Args:
        ref_b: commands at ``RATE_HZ`` [m], shape (Q, N, 3).
        ticks: control ticks per command.

    Returns:
        Positions [m] and rates [m/s], shape (Q * ticks, N, 3); the last command is held.
    """
    times = np.arange(len(ref_b)) / RATE_HZ
    spline = CubicSpline(times, ref_b, bc_type="clamped")
    at = np.minimum(np.arange(len(ref_b) * ticks) / (ticks * RATE_HZ), times[-1])
    return spline(at), spline(at, 1)


def _check_commands(scene: TeamScene, trajectory: Trajectory) -> None:
    if trajectory.ref_b.shape[1:] != (scene.robots, 3):
        raise InputError(
            f"the trajectory is for {trajectory.ref_b.shape[1]} robots; the scene has {scene.robots}"
        )
    design = omnid_design()
    reach = np.linalg.norm(trajectory.ref_b - [0.0, 0.0, design.home_height_m], axis=-1)
    if not reach.max() <= design.workspace_radius_m:
        sample, robot = np.unravel_index(np.argmax(reach), reach.shape)
        raise InputError(
            f"omnid{robot + 1}: the command at t = {sample / RATE_HZ:.2f} s is {reach.max():.3f} m from home; "
            f"the workspace ends at {design.workspace_radius_m:g} m"
        )


class _Buffers:
    """Rows of a trial as they are written, and the checks on them."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, samples: int,
        slack_m: tuple[float, ...] = (),
    ) -> None:  # fmt: skip
        self.model, self.data, self.index = model, data, index
        robots = index.robots
        self.weld_limit_m = WELD_LIMIT_M + np.array(slack_m or (0.0,) * robots)
        tip, platform = [], []
        for i in range(robots):
            for k in (1, 2, 3):
                tip.append(model.site(f"omnid{i + 1}/rod{k}_tip").id)
                platform.append(model.site(f"omnid{i + 1}/platform{k}").id)
        self.sites = np.array([*index.grasp_site, *index.payload_site, *tip, *platform])
        self.qpos = np.empty((samples, model.nq))
        self.spring_force = np.empty((samples, model.nv))
        self.site_xpos = np.empty((samples, len(self.sites), 3))
        self.site_xmat = np.empty((samples, 2 * robots, 9))

    def before_step(self, sample: int) -> None:
        self.qpos[sample] = self.data.qpos

    def after_step(self, sample: int) -> None:
        self.spring_force[sample] = self.data.qfrc_spring
        self.site_xpos[sample] = self.data.site_xpos[self.sites]
        self.site_xmat[sample] = self.data.site_xmat[self.sites[: 2 * self.index.robots]]

    def phi(self, rows: slice, design: OmnidDesign) -> Array:
        q = self.qpos[rows]
        return home_phi(design) + q[:, self.index.motor_qpos] + q[:, self.index.spring_qpos]

    def theta(self, rows: slice) -> Array:
        return self.qpos[rows][:, self.index.gimbal_qpos]

    def tau(self, rows: slice) -> Array:
        return self.spring_force[rows][:, self.index.spring_dof]

    def errors(self, rows: slice) -> tuple[Array, Array, Array]:
        """Rod and weld opening [m] and weld angle [rad] per row and constraint."""
        n = self.index.robots
        xpos, xmat = self.site_xpos[rows], self.site_xmat[rows].reshape(-1, 2 * n, 3, 3)
        rod = np.linalg.norm(xpos[:, 2 * n : 5 * n] - xpos[:, 5 * n :], axis=-1)
        weld = np.linalg.norm(xpos[:, :n] - xpos[:, n : 2 * n], axis=-1)
        # |R1 - R2|_F = 2 sqrt(2) sin(angle / 2): exact for the tiny angles here, where arccos is not.
        angle = np.linalg.norm(xmat[:, :n] - xmat[:, n:], axis=(-2, -1)) / np.sqrt(2.0)
        return rod, weld, angle

    def check(self, start: int, stop: int, design: OmnidDesign) -> None:
        """Check the rows since the last check."""
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
        for i, limit in enumerate(self.weld_limit_m):
            _limit("weld error", weld[:, i : i + 1, None], 0.0, limit, "m", when, robot=i)
        _limit("weld angle", angle[:, :, None], 0.0, WELD_LIMIT_RAD, "rad", when)

    def finish(
        self,
        trajectory: Trajectory,
        feed_forward: Array,
        gains: ControlGains,
        scene: TeamScene,
        sensed: SensedLog,
    ) -> TrialLog:
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
