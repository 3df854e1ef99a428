"""Simulate one trial from a request: build the team, run the trial, make recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from estimator.errors import InputError
from estimator.recording.metadata import FREE, TRIALS
from estimator.recording.model import Recording
from mocobot_sim.control.control import ControlGains
from mocobot_sim.effects import Effect, apply_effects
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.payload import grasp_frames, load_payload
from mocobot_sim.scene.scene import TeamScene, build_free_team, build_team, check_robots
from mocobot_sim.trial.sensors import PRESETS, SensorPreset, measure
from mocobot_sim.trial.trajectories import (
    RATE_HZ,
    Trajectory,
    free_motion,
    random_vias,
    sphere_motion,
    static_orientations,
)
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth

DRIVEN = ("random", "periodic")
"""Kinds of trial in which bases may drive."""
LEFT_RAD = 0.3
"""Largest initial angle of a gimbal without payload [rad]. Chosen."""


@dataclass(frozen=True)
class TrialRequest:
    """Specification of one trial; equal requests give identical results."""

    # name of a shipped payload, or path of a payload MJCF; a free trial uses only its name and its number of grasps
    payload: str
    trial: str  # ``random``, ``periodic``, ``static`` or ``free``
    seed: int = 0  # seed of all random numbers, at least 0
    number: int = 0  # index among the trials of that kind, from 0
    vias: int = 80  # number of vias of a random trial, or of the fast part of a free trial
    duration_s: float = 60.0  # length of a periodic trial's motion [s]
    robots: int | None = None  # number of robots of a free trial; None for the payload's number of grasps
    drive: float | None = None  # relative errors of the odometry of driving bases; None for bases that stand

    @property
    def label(self) -> str:
        """Name of the payload; for a custom payload, the name of its file without suffix."""
        return Path(self.payload).stem

    def rng(self, purpose: str) -> np.random.Generator:
        """Random generator for one purpose of this trial, independent of those for other purposes."""
        words = f"{purpose}|{self.label}|{self.trial}|{self.number}".encode()
        return np.random.default_rng(np.random.SeedSequence([self.seed, *words]))


@dataclass(frozen=True)
class Simulated:
    """Result of a simulated trial."""

    recordings: dict[str, Recording]  # one per sensor preset, by its name
    log: TrialLog  # true motion and torques
    scene: TeamScene  # the team with its effects

    @cached_property
    def truth(self) -> GroundTruth:
        """Ground truth of payload and robots; compiles the model again."""
        return replace(GroundTruth.of(self.scene), control=self.log.stability, position=self.log.joint)


def simulate(
    request: TrialRequest,
    presets: Sequence[SensorPreset],
    grasps: RigidTransform | None = None,
    gains: ControlGains | None = None,
    progress: Callable[[int, int], object] | None = None,
    scene: TeamScene | None = None,
    effects: Sequence[Effect] = (),
    units: Sequence[AsBuilt] = (),
    place: int | None = None,
) -> Simulated:
    """Run one trial and make a recording with each of several sensor presets.

    Presets with the same calibration spread can share a trial, because noise and quantisation of the logged channels
    do not affect the motion. The deviations of the robots depend on the seed only, so all trials of a team have the
    same robots.

    Args:
        request: specification of the trial.
        presets: sensor presets, all with the same calibration spread.
        grasps: estimated grasp frames X_1i for the construction of periodic and static trajectories, N transforms;
            None for the true ones.
        gains: control gains; None for the defaults.
        progress: called with the number of samples done and the total number of samples.
        scene: team to use instead of building one; ``request.payload`` is then only a label, and the presets must be
            calibrated ones.
        effects: effects to add to the team.
        units: deviations of the robots, instead of those drawn by the presets; the presets must be calibrated ones.
        place: number of the trial, from 1, to which effects such as a push refer; None for ``request.number`` + 1.

    Raises:
        InputError: the request or a preset is invalid, or they do not fit together.
        TrialError: the simulation failed a check.
    """
    _check(request, presets, scene, units)
    free = request.trial == FREE
    if free:
        scene = _free_team(request, presets[0], units)
    elif scene is None:
        units = units or draw_units(request.payload, presets[0], request.seed)
        scene = build_team(request.payload, units, released=request.drive is not None)
    if effects:
        scene = apply_effects(scene, effects)
    trajectory = make_trajectory(request, scene, grasps)
    number = request.number + 1 if place is None else place
    drive = None
    if request.drive is not None:
        from mocobot_sim.base.drive import wandering  # imports this package

        seconds = (len(trajectory.ref_b) - 1) / RATE_HZ
        drive = wandering(scene, seconds, request.drive, request.rng("drive"))
    actors = () if drive is None else (drive,)
    log = run_trial(scene, trajectory, gains, progress, trial_number=number, actors=actors)
    label, recordings = f"{request.label}_{request.trial}{request.number}", {}
    for preset in presets:
        rng, name = request.rng(f"sensors {preset.name}"), f"{label}_{preset.name}"
        payload = None if free else request.label
        measured = measure(log, preset, rng, payload, request.seed, name)
        if drive is not None:
            measured = replace(measured, base=drive.measured(preset.encoder_bits, rng))
        recordings[preset.name] = measured
    return Simulated(recordings, log, scene)


def _check(
    request: TrialRequest,
    presets: Sequence[SensorPreset],
    scene: TeamScene | None,
    units: Sequence[AsBuilt],
) -> None:
    """Raise ``InputError`` if a request or preset is invalid, or they do not fit together."""
    if request.trial not in TRIALS:
        raise InputError(f"trial {request.trial!r} does not exist; the trials are {', '.join(TRIALS)}")
    if len({preset.spread for preset in presets}) != 1:
        raise InputError("presets of one trial must share their calibration spread")
    if request.seed < 0:
        raise InputError(f"seed is {request.seed}; it must be at least 0")
    free = request.trial == FREE
    if free and scene is not None:
        raise InputError("a model carries a payload; robots of a free trial hold nothing")
    if request.drive is not None and (request.trial not in DRIVEN or scene is not None):
        raise InputError(
            f"bases drive in {' and '.join(DRIVEN)} trials of a payload, without a model; this one is {request.trial}"
        )
    if request.robots is not None and not free:
        raise InputError(f"robots is for a free trial; a {request.trial} one has a robot for each grasp")
    if (scene is not None or units) and not presets[0].calibrated:
        who = "units are given, which already say" if scene is None else "the model already says"
        raise InputError(
            f"preset {presets[0].name!r} draws robots of its own, but {who} how its robots deviate; "
            f"use {' or '.join(name for name, preset in PRESETS.items() if preset.calibrated)}"
        )


def draw_units(
    payload: str, preset: SensorPreset, seed: int, robots: int | None = None
) -> tuple[AsBuilt, ...]:
    """Draw the deviations of a team's robots from the seed; empty (as designed) if the preset is calibrated.

    Args:
        payload: name or path of the payload.
        preset: sensor preset with the standard deviations.
        seed: seed of the team.
        robots: number of robots; None for the number of grasps of the payload.
    """
    if preset.calibrated:
        return ()
    return preset.spread.draw(robots or _grasps(payload), np.random.default_rng([seed, *b"units"]))


def _grasps(payload: str) -> int:
    return len(grasp_frames(load_payload(payload), payload))


def _free_team(request: TrialRequest, preset: SensorPreset, units: Sequence[AsBuilt]) -> TeamScene:
    """Build a team without payload: the robots of the seed's other trials, with random gimbal angles."""
    robots = _grasps(request.payload) if request.robots is None else request.robots
    check_robots(robots)
    theta = request.rng("gimbals").uniform(-LEFT_RAD, LEFT_RAD, (robots, 3))
    units = units or draw_units(request.payload, preset, request.seed, robots)
    return build_free_team(robots, units, theta)


def make_trajectory(
    request: TrialRequest, scene: TeamScene, grasps: RigidTransform | None = None
) -> Trajectory:
    """Make the commands of a request; arguments as in ``simulate``."""
    home, X_1i = scene.wrist_home_b, scene.X_1i if grasps is None else grasps
    rng = request.rng("trajectory")
    if request.trial == "random":
        return random_vias(home, rng, vias=request.vias)
    if request.trial == FREE:
        return free_motion(home, rng, vias=request.vias)
    joint = scene.payload_joint()
    if request.trial == "periodic":
        return sphere_motion(home, X_1i, duration_s=request.duration_s, rng=rng, joint=joint)
    return static_orientations(home, X_1i, joint=joint)
