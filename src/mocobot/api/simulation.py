"""Simulate trials of a team."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot.option_types import made
from mocobot.options import SimulateOptions
from mocobot.results import public
from mocobot_sim.control.control import ControlGains
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.catalogue import parse_effect
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.as_built import read_units
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import DRIVEN, TrialRequest
from mocobot_sim.trial.simulate import simulate as simulate_request
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth, write_truth

Progress = Callable[[int, int, int], object]


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRecording(Recording):
    """A simulated recording with its ground truth, which neither estimates nor diagnoses use.

    Attributes:
        truth: true parameters of the robots and, if there is one, of the payload.
        log: true motion and forces, before any sensor.
    """

    truth: GroundTruth
    log: TrialLog

    def write(self, path: Path | str) -> None:
        """Write the recording as Parquet, and the truth beside it as ``NAME.truth.json``.

        Raises:
            InputError: a file cannot be written.
        """
        write_recording(self, path)
        write_truth(self.truth, Path(path))


def simulate(
    payload: str | Path | None = None,
    trajectory: str = "random",
    options: SimulateOptions | None = None,
    *,
    number: int = 0,
    gains: ControlGains | None = None,
    progress: Callable[[int, int], object] | None = None,
    **fields: Any,
) -> SimulatedRecording:
    """Simulate one trial and measure it with the sensors; equal arguments give equal bits.

    Args:
        payload: name of a shipped payload, or path of a payload MJCF (body ``payload``, sites ``grasp1`` ..
            ``graspN``); default: ``"a"``, unless a model is given. In a free trial it only sets the number of robots.
        trajectory: ``"random"``, ``"periodic"``, ``"static"``, or ``"free"``: every arm moves alone and holds nothing.
        options: options of the simulation; ``fields`` replace its fields. Effects may be objects of ``make_effect``
            or text; preset and units may be objects. Without units, the preset determines the robots.
        number: index of the trial among those of its kind, from 0; each index has its own noise.
        gains: control gains of the arms; None for the defaults.
        progress: called after every second of the trial with the number of samples done and their total.

    Raises:
        InputError: an argument is invalid.
        TrialError: the physics of the trial cannot be trusted.
    """
    chosen = made(SimulateOptions, options, fields)
    (done,) = _simulated(
        payload, [trajectory], chosen, number, gains, progress and (lambda _, *done: progress(*done))
    )
    return done


def simulate_trials(
    payload: str | Path | None = None,
    trajectories: Sequence[str] = ("random", "random", "periodic", "static"),
    options: SimulateOptions | None = None,
    *,
    gains: ControlGains | None = None,
    progress: Progress | None = None,
    **fields: Any,
) -> list[SimulatedRecording]:
    """Simulate several trials of one team: the same robots at the same places, with the same hidden effects.

    Args:
        trajectories: kind of every trial, in order; the parameter ``trial`` of an effect counts them from 1.
        payload, options, gains: as for ``simulate``; vias, duration and robots apply to trials of matching kind.
        progress: called with the trial (from 1), the number of its samples done and their total.

    Raises:
        InputError: an argument is invalid.
        TrialError: the physics of a trial cannot be trusted.
    """
    chosen = made(SimulateOptions, options, fields)
    if not trajectories:
        raise InputError("no trial given; name at least one")
    chosen = replace(chosen, effects=_effects(chosen))
    for effect in chosen.effects:
        if (trial := getattr(effect, "trial", 1)) > len(trajectories):
            cause = getattr(effect, "cause", effect)
            raise InputError(f"{cause}: trial is {trial}; the trials are 1 .. {len(trajectories)}")
    return _simulated(payload, trajectories, chosen, 0, gains, progress)


def _effects(chosen: SimulateOptions) -> list[Effect]:
    return [parse_effect(effect) if isinstance(effect, str) else effect for effect in chosen.effects]


def _simulated(
    payload: str | Path | None,
    trajectories: Sequence[str],
    chosen: SimulateOptions,
    first: int,
    gains: ControlGains | None,
    progress: Progress | None,
) -> list[SimulatedRecording]:
    """Simulate trials of one team; the index among trials of one kind starts at ``first``."""
    chosen.check_for(payload, trajectories)
    model, units, preset = chosen.model, chosen.units, chosen.preset
    if model is not None and FREE in trajectories:
        raise InputError(f"model {model} carries a payload; robots of a free trial hold nothing")
    team = read_units(Path(units)) if isinstance(units, str | Path) else units or ()
    label = str("a" if payload is None else payload) if model is None else Path(model).resolve().name
    sensors = sensor_preset(preset) if isinstance(preset, str) else preset
    effects, recordings = _effects(chosen), []
    for k, kind in enumerate(trajectories):
        number = first + list(trajectories[:k]).count(kind)
        robots = chosen.robots if kind == FREE else None
        drive = chosen.drive if kind in DRIVEN else None
        given = {"drive": drive, "vias": chosen.vias, "duration_s": chosen.duration_s, "robots": robots}
        request = replace(
            TrialRequest(label, kind, chosen.seed, number),
            **{name: value for name, value in given.items() if value is not None},
        )
        done = simulate_request(
            request, [sensors],
            gains=gains, effects=effects, units=team, place=first + k + 1,
            progress=progress and partial(progress, k + 1),
            scene=None if model is None else load_extended(Path(model)),
        )  # fmt: skip
        recording = done.recordings[sensors.name]
        metadata = replace(recording.metadata, level=chosen.level)
        recordings.append(
            public(SimulatedRecording, recording, metadata=metadata, truth=done.truth, log=done.log)
        )
    return recordings
