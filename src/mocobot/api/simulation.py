"""Simulate one trial."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from estimator.errors import InputError
from estimator.recording.metadata import FREE, Level
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot.api.public import public
from mocobot_sim.control.control import ControlGains
from mocobot_sim.effects.base import Effect
from mocobot_sim.extended.extended import load_extended
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
        model: folder of an extended model, as a diagnosis writes it, in place of a payload.
        level: what the recording's file will hold: ``"joint"``, driven angles and spring torques, or ``"wrist"``.
        robots: number of robots of a free trial, in place of a payload; a seed's robots are the same in all its trials.
        gains: of the arms' control; None for the defaults.
        progress: called with the number of samples done and that of all, every second of the trial.

    Raises:
        InputError: an argument that cannot be met.
        TrialError: the physics of the trial cannot be trusted.
    """
    check_fits("vias", vias, ("random", "free"), trajectory)
    check_fits("duration_s", duration_s, ("periodic",), trajectory)
    check_fits("robots", robots, ("free",), trajectory)
    if payload is not None and robots is not None:
        raise InputError("payload and robots are both given; a payload says how many robots there are")
    if model is not None and trajectory == FREE:
        raise InputError(f"model {model} carries a payload; robots of a free trial hold nothing")
    if model is not None and payload is not None:
        raise InputError("payload and model are both given; the model has its own payload, so leave one out")
    scene = load_extended(Path(model)) if model is not None else None
    label = str("a" if payload is None else payload) if model is None else Path(model).resolve().name
    sensors = sensor_preset(preset) if isinstance(preset, str) else preset
    given = {"vias": vias, "duration_s": duration_s, "robots": robots}
    request = replace(
        TrialRequest(label, trajectory, seed, number),
        **{name: value for name, value in given.items() if value is not None},
    )
    done = simulate_request(request, [sensors], gains=gains, progress=progress, scene=scene, effects=effects)
    recording = done.recordings[sensors.name]
    metadata = replace(recording.metadata, level=level)
    return public(SimulatedRecording, recording, metadata=metadata, truth=done.truth, log=done.log)


def check_fits(name: str, value: float | None, needed: tuple[str, ...], trajectory: str) -> None:
    """Refuse a number that says nothing about a kind of motion.

    Raises:
        InputError: it is given, and the trajectory is none of those that need it.
    """
    if value is not None and trajectory not in needed:
        raise InputError(f"{name} is for a {' or '.join(needed)} trajectory; this one is {trajectory}")
