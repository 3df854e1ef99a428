"""Run one trial: physics and control at 1 kHz, logged at 100 Hz, with checks of the simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains, TeamController, control_stability
from mocobot_sim.effects.payload import PayloadMass, Push
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.actors import Actor, Reader, Stage
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import RATE_HZ, Trajectory
from mocobot_sim.trial.trial_log import Rows, SensedLog, TrialLog


@dataclass(frozen=True)
class _Others:
    """Actors, readers and pushes of one trial, each in the order in which they act."""

    actors: tuple[Actor, ...]
    readers: tuple[Reader, ...]
    pushes: tuple[Push, ...]
    carries: bool  # whether there is a payload
    R_Wb1: Array  # orientation of robot 1's {b} in the world, shape (3, 3)

    @classmethod
    def of(cls, scene: TeamScene, trial_number: int | None, actors: Sequence[Actor]) -> _Others:
        """Collect the given actors, then those, the readers and the pushes of the scene's effects."""
        pushes = (effect for effect in scene.effects if isinstance(effect, Push))
        return cls(
            (*actors, *(actor for effect in scene.effects for actor in effect.actors(trial_number))),
            tuple(reader for effect in scene.effects for reader in effect.readers(trial_number)),
            tuple(push for push in pushes if trial_number in (None, push.trial)),
            scene.carries,
            scene.mounts.rotation[0].as_matrix(),
        )

    def __bool__(self) -> bool:
        return bool(self.actors or self.readers or self.pushes)

    def start(self, stage: Stage) -> None:
        """Start all actors and readers."""
        for part in (*self.actors, *self.readers):
            part.start(stage)

    def before_control(self, stage: Stage, tick: int, seen: Array) -> None:
        """Clear applied forces, run the actors, then let readers change ``seen`` in place, shape (nq,)."""
        data = stage.data
        if self.carries and (self.pushes or self.actors):
            data.xfrc_applied[stage.index.payload_body] = 0.0
            data.xfrc_applied[stage.model.dof_bodyid[stage.index.payload_dof]] = 0.0
        if self.actors:
            data.qfrc_applied[:] = 0.0
        for actor in self.actors:
            actor.act(tick)
        if self.readers:
            seen[:] = data.qpos
            for reader in self.readers:
                reader.read(tick, seen)

    def after_control(self, stage: Stage) -> None:
        """Apply the pushes that are active now."""
        for push in self.pushes:
            if push.acts(stage.data.time):
                mujoco.mj_kinematics(stage.model, stage.data)
                push.act(stage.data, stage.index.payload_body, self.R_Wb1)


def run_trial(
    scene: TeamScene,
    trajectory: Trajectory,
    gains: ControlGains | None = None,
    progress: Callable[[int, int], object] | None = None,
    *,
    trial_number: int | None = None,
    feed_forward: Array | None = None,
    timestep_s: float | None = None,
    actors: Sequence[Actor] = (),
) -> TrialLog:
    """Simulate one trial in closed loop.

    Args:
        scene: the team; ``scene.units`` gives the sensor zeros that its controllers see.
        trajectory: commands.
        gains: control gains; None for the defaults.
        progress: called with the number of samples done and the total number, first with 0 and then once per simulated
            second.
        trial_number: number of the trial, from 1; effects for other trials do not act, None lets all act.
        feed_forward: constant feed-forward force of every robot in its {b} [N], shape (N, 3). With None the controller
            takes up the load; without payload the force is then zero.
        timestep_s: integration step [s]; None for that of the scene.
        actors: additional actors, such as driving bases or a person's hand.

    Raises:
        TrialError: a constraint opens too far, a value is not finite, MuJoCo warns, or a joint or spring
            leaves its range.
        InputError: the team cannot be assembled; the trajectory is for another number of robots or leaves
            the workspace; or rates and time step are not whole multiples of each other.
    """
    _check_commands(scene, trajectory)
    gains = gains or ControlGains()
    model = scene.compile()
    if timestep_s is not None:
        model.opt.timestep = timestep_s
    data = mujoco.MjData(model)
    index = TeamIndex.of(model, scene.carries)
    design = omnid_design()
    for effect in scene.effects:
        if isinstance(effect, PayloadMass):
            effect.load(model, index, trial_number)
    assemble_at_home(scene, model, data, index)
    ticks = _whole("control rate over recording rate", gains.rate_hz / RATE_HZ)
    substeps = _whole("control period over time step", 1.0 / (gains.rate_hz * model.opt.timestep))
    commands = np.stack(between_commands(trajectory.ref_b, ticks), axis=1)
    if feed_forward is None and not scene.carries:
        feed_forward = np.zeros((index.robots, 3))
    parked = not actors and not index.base_dof.size
    stability = control_stability(scene, model, data, gains, trajectory.ref_b[0]) if parked else None
    sensed = np.empty((len(commands), index.robots, 3, 3))
    others = _Others.of(scene, trial_number, actors)
    seen = data.qpos.copy() if others.readers else data.qpos
    controller = TeamController(
        index, design, gains, data, scene.units, scene.sensors, feed_forward, commands, sensed, seen
    )
    log = Rows(model, data, index, len(trajectory.ref_b), scene.grasp_slack_m, scene.grasp_slack_rad)
    stage = Stage(model, data, index, controller, gains.rate_hz, ticks, len(commands))
    others.start(stage)
    disturbed, step = bool(others), mujoco.mj_step
    reported, last = 0, len(trajectory.ref_b) - 1
    if progress:
        progress(0, last + 1)
    for sample in range(last + 1):
        for tick in range(sample * ticks, (sample + 1) * ticks):
            if disturbed:
                others.before_control(stage, tick, seen)
            controller.tick()
            if disturbed:
                others.after_control(stage)
            if tick == sample * ticks:
                # A step first evaluates forces and frames at its initial state, so the whole row has one instant.
                log.before_step(sample)
                step(model, data)
                log.after_step(sample)
                remaining = substeps - 1
            else:
                remaining = substeps
            if remaining:
                step(model, data, remaining)  # positional arguments are faster
        if sample % 100 == 99 or sample == last:
            log.check(reported, sample + 1, design)
            if progress:
                progress(sample + 1, last + 1)
            reported = sample + 1
    phi, theta, tau = (np.ascontiguousarray(sensed[:, :, k]) for k in range(3))
    seen_by_sensors = SensedLog(gains.rate_hz, ticks, phi, theta, tau)
    return log.finish(trajectory, controller.feed_forward, gains, scene, seen_by_sensors, stability)


def _whole(name: str, ratio: float) -> int:
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise InputError(f"the {name} is {ratio:.4g}; it must be a whole number of at least 1")
    return round(ratio)


def between_commands(ref_b: Array, ticks: int) -> tuple[Array, Array]:
    """Interpolate commands to the control rate by a cubic spline that is at rest at both ends.

    Linear interpolation would make the velocity jump at every sample. The resulting ripple is synchronous with the
    sampling, so it aliases into the torques instead of averaging out (error of inertia up to 0.12 %).

    Returns:
        Positions [m] and rates [m/s] at ``ticks`` per command, shapes (Q * ticks, N, 3); the last command is held.
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
