"""Simulate one trial."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from estimator.errors import InputError
from estimator.recording.metadata import FREE, Level
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot.api.public import public
from mocobot.checks import check_fits
from mocobot_sim.control.control import ControlGains
from mocobot_sim.effects.base import Effect
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.as_built import AsBuilt, read_units
from mocobot_sim.trial.sensors import SensorPreset, sensor_preset
from mocobot_sim.trial.simulate import TrialRequest
from mocobot_sim.trial.simulate import simulate as simulate_request
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth, write_truth


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRecording(Recording):
    """A recording with what is known because it was simulated; nothing that estimates or diagnoses looks at it.

    Attributes:
        truth: the payload, if there is one, and the robots.
        log: what truly happened, before any sensor.
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
    *,
    vias: int | None = None,
    duration_s: float | None = None,
    preset: SensorPreset | str = "nominal",
    seed: int = 0,
    number: int = 0,
    effects: Sequence[Effect] = (),
    units: Sequence[AsBuilt] | Path | str = (),
    model: Path | str | None = None,
    level: Level = "joint",
    robots: int | None = None,
    gains: ControlGains | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SimulatedRecording:
    """Simulate one trial and read it through the sensors; equal arguments give equal bits.

    Args:
        payload: name of a shipped payload, or path of a payload MJCF (body ``payload``, sites ``grasp1`` ..
            ``graspN``); ``"a"`` if neither this nor a model is given. Of a free trial: the one that the robots have put
            down, which says how many they are.
        trajectory: ``"random"``, ``"periodic"``, ``"static"``, or ``"free"``: every arm moves alone and holds nothing.
        vias: vias of a random trial, or of a free one's fast part; 80 if not given.
        duration_s: length of a periodic motion [s]; 60 if not given.
        preset: sensors, or their name: ``"ideal"``, ``"nominal"`` or ``"uncalibrated"``.
        seed: of trajectory, noise and calibration errors, at least 0.
        number: which of several trials of that kind, at least 0; the noise differs from one to the next.
        effects: what is hidden in the team (``make_effect``).
        units: the robots as built, or the JSON file that says so (docs/simulation.md); the preset must be a calibrated
            one. As the preset has them if empty.
        model: folder of an extended model, as a diagnosis writes it, in place of a payload.
        level: what the recording's file will hold: ``"joint"``, driven angles and spring torques, or ``"wrist"``.
        robots: number of robots of a free trial, in place of a payload; a seed's robots are the same in all its trials.
        gains: of the arms' control; None for the defaults.
        progress: called with the number of samples done and that of all, every second of the trial.

    Raises:
        InputError: an argument that cannot be met.
        TrialError: the physics of the trial cannot be trusted.
    """
    (done,) = _simulated(
        payload, [trajectory],
        vias=vias, duration_s=duration_s, preset=preset, seed=seed, first=number, effects=effects, units=units,
        model=model, level=level, robots=robots, gains=gains,
        progress=progress and (lambda _, *done: progress(*done)),
    )  # fmt: skip
    return done


def simulate_trials(
    payload: str | Path | None = None,
    trajectories: Sequence[str] = ("random", "random", "periodic", "static"),
    *,
    vias: int | None = None,
    duration_s: float | None = None,
    preset: SensorPreset | str = "nominal",
    seed: int = 0,
    effects: Sequence[Effect] = (),
    units: Sequence[AsBuilt] | Path | str = (),
    model: Path | str | None = None,
    level: Level = "joint",
    robots: int | None = None,
    gains: ControlGains | None = None,
    progress: Callable[[int, int, int], object] | None = None,
) -> list[SimulatedRecording]:
    """Simulate several trials of one team: the same robots at the same places, and the same hidden in them.

    Args:
        trajectories: kind of every trial, in order; the first is trial 1 of a push.
        payload, vias, duration_s, preset, seed, effects, units, model, level, robots, gains: as of ``simulate``; vias,
            duration and robots are for the trials that they say something about.
        progress: called with the trial (from 1 on), the number of its samples done and that of all its samples.

    Raises:
        InputError: an argument that cannot be met.
        TrialError: the physics of a trial cannot be trusted.
    """
    if not trajectories:
        raise InputError("no trial given; name at least one")
    for effect in effects:
        if (trial := getattr(effect, "trial", 1)) > len(trajectories):
            raise InputError(f"{effect.cause}: trial is {trial}; the trials are 1 .. {len(trajectories)}")
    return _simulated(
        payload, trajectories,
        vias=vias, duration_s=duration_s, preset=preset, seed=seed, first=0, effects=effects, units=units,
        model=model, level=level, robots=robots, gains=gains, progress=progress,
    )  # fmt: skip


def _simulated(
    payload: str | Path | None,
    trajectories: Sequence[str],
    *,
    vias: int | None,
    duration_s: float | None,
    preset: SensorPreset | str,
    seed: int,
    first: int,
    effects: Sequence[Effect],
    units: Sequence[AsBuilt] | Path | str,
    model: Path | str | None,
    level: Level,
    robots: int | None,
    gains: ControlGains | None,
    progress: Callable[[int, int, int], object] | None,
) -> list[SimulatedRecording]:
    """Trials of one team, those of a kind numbered from ``first`` on."""
    check_fits("vias", vias, ("random", "free"), trajectories)
    check_fits("duration_s", duration_s, ("periodic",), trajectories)
    check_fits("robots", robots, ("free",), trajectories)
    if payload is not None and robots is not None:
        raise InputError("payload and robots are both given; a payload says how many robots there are")
    if model is not None and FREE in trajectories:
        raise InputError(f"model {model} carries a payload; robots of a free trial hold nothing")
    if model is not None and payload is not None:
        raise InputError("payload and model are both given; the model has its own payload, so leave one out")
    if model is not None and units:
        raise InputError("units and model are both given; the model has robots of its own, so leave one out")
    team = read_units(Path(units)) if isinstance(units, str | Path) else units
    label = str("a" if payload is None else payload) if model is None else Path(model).resolve().name
    sensors = sensor_preset(preset) if isinstance(preset, str) else preset
    numbers = [first + list(trajectories[:k]).count(kind) for k, kind in enumerate(trajectories)]
    recordings = []
    for place, (kind, number) in enumerate(zip(trajectories, numbers, strict=True), start=1):
        given = {"vias": vias, "duration_s": duration_s, "robots": robots if kind == FREE else None}
        request = replace(
            TrialRequest(label, kind, seed, number),
            **{name: value for name, value in given.items() if value is not None},
        )
        done = simulate_request(
            request, [sensors],
            gains=gains, effects=effects, units=team, place=first + place,
            progress=progress and partial(progress, place),
            scene=None if model is None else load_extended(Path(model)),
        )  # fmt: skip
        recording = done.recordings[sensors.name]
        metadata = replace(recording.metadata, level=level)
        recordings.append(
            public(SimulatedRecording, recording, metadata=metadata, truth=done.truth, log=done.log)
        )
    return recordings
