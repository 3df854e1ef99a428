"""Resimulation: run the commands of a recording in closed loop again and predict the readings of its sensors."""

import json
from dataclasses import replace

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.model import Recording
from mocobot_sim.control.control import ControlGains
from mocobot_sim.scene.scene import TIMESTEP_S, TeamScene
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import RATE_HZ, Trajectory
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog


def resimulate(
    recording: Recording,
    scene: TeamScene,
    gains: ControlGains | None = None,
    timestep_s: float = TIMESTEP_S,
    trial_number: int | None = None,
) -> TrialLog:
    """Simulate the commands of a recording with a given team.

    The robots follow the recorded commands with the recorded gains and the recorded feed-forward force. They start at
    rest near the first recorded posture. The load take-up is not repeated, so the first seconds differ.

    Args:
        recording: recording with commands and ``control`` (see docs/recording.md).
        scene: team to simulate.
        gains: control gains; None for the recorded ones.
        timestep_s: integration step [s].
        trial_number: number of the trial, from 1, to which effects such as a push refer; None lets all act.

    Raises:
        InputError: the recording lacks commands or control, or has another number of robots or another rate.
        TrialError: the simulation failed a check.
    """
    meta = recording.metadata
    if recording.base is not None:
        raise InputError(
            f"{recording.name}: is of driving bases; only trials of standing ones are resimulated"
        )
    if recording.ref is None:
        raise InputError(
            f"{recording.name}: has no commands (ref_x, ref_y, ref_z); resimulating it needs them"
        )
    if meta.control is None:
        raise InputError(f"{recording.name}: metadata has no 'control'; resimulating it needs it")
    if meta.robots != scene.robots:
        raise InputError(
            f"{recording.name}: was recorded with {meta.robots} robots; the scene has {scene.robots}"
        )
    if meta.rate_hz != RATE_HZ:
        raise InputError(f"{recording.name}: rate_hz is {meta.rate_hz:g}; resimulating it needs {RATE_HZ:g}")
    feed_forward = _feed_forward(recording)
    try:
        gains = gains or ControlGains.from_dict(meta.control)
    except InputError as error:
        raise InputError(f"{recording.name}: {error}") from error
    phi = recording.phi[0] - [unit.phi_zero_rad for unit in scene.units]
    theta = recording.theta[0] - [unit.theta_zero_rad for unit in scene.units]
    return run_trial(
        replace(scene, initial=(phi, theta)),
        Trajectory(meta.trial, recording.ref),
        gains,
        trial_number=trial_number,
        feed_forward=feed_forward,
        timestep_s=timestep_s,
    )


def _feed_forward(recording: Recording) -> Array:
    given, robots = (recording.metadata.control or {}).get("feed_forward_N"), recording.metadata.robots
    try:
        force = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        force = np.array(np.nan)
    if force.shape != (robots, 3) or not np.isfinite(force).all():
        raise InputError(
            f"{recording.name}: control.feed_forward_N is {json.dumps(given):.60}; "
            f"it must be {robots} x 3 finite numbers"
        )
    return force


def predicted(log: TrialLog) -> Recording:
    """Recording of a trial by sensors without noise or quantisation, with the team's zeros and timing faults."""
    return measure(log, sensor_preset("ideal"), np.random.default_rng(0), name="predicted")
