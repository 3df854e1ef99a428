"""Calibrate the robots of a team from recordings of the payloads that they carry, or a single robot from joint logs.

Folder of a single robot: as_found.xml with its assets, parameters.csv, calibration.json (see
``discrepancy.joints.calibrated``), report.txt, torques.png or forecasts.png, what predictions leave, and for robots
that are known by their commands actuators.json (see ``discrepancy.joints.actuators``) and log.toml, the map with what
was found of their loops. Folder of a team:

calibration.json           see ``estimator.calibrate.json``
report.txt                 text that the command prints
omnid1.toml ...            calibrated parameters of every robot
model, or model-1 ...      calibrated team in MuJoCo, one per payload, for ``mocobot simulate --model``
deviations.png, recordings.png, shares.png
                           parameters against priors, misfit of each recording, information from each recording
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from discrepancy.joints import calibrated
from discrepancy.joints.calibration import ArmCalibration, calibrate_arm
from estimator.calibrate.calibrate import calibrate as fit
from estimator.calibrate.calibration import Calibration as Below
from estimator.calibrate.flanges import in_drawing_frames
from estimator.calibrate.json import calibration_to_dict
from estimator.calibrate.prior import Prior, read_prior
from estimator.calibrate.text import format_calibration, unit_toml
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.recording.model import Recording
from mocobot.api.recordings import Given, Say, calibration_of, quiet, recordings_of
from mocobot.checks import CALIBRATION
from mocobot.option_types import made
from mocobot.options import CalibrateOptions
from mocobot.results import Folder, public
from mocobot_logs.joints.joint_log import Drive, JointLog
from mocobot_logs.joints.map_text import with_control

if TYPE_CHECKING:
    from mocobot.api.joints import GivenLogs, GivenModel

TILT_RAD, ARM_MASS_RATIO = float(np.deg2rad(0.2)), 0.1
"""Prior standard deviations of base tilt [rad] and relative arm mass, if requested and the prior has none. Chosen."""
WEIGHED = 1e-3
"""Relative standard error of a weight that is given without one. Chosen."""
Weight = float | tuple[float, float]
REPORT, MODEL = "report.txt", "model"


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Folder, Below):
    """Calibrated robots and their payloads; prints as text, shows as a table in a notebook, writes a folder.

    The attributes are those of ``estimator.calibrate.calibration.Calibration``. ``simulate`` accepts the folder's
    ``model``.
    """

    result = "calibration"

    def __str__(self) -> str:
        """Return the text report."""
        return format_calibration(self)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        held = ", ".join(f"{payload.parameters[0]:.4g} kg" for payload in self.payloads)
        return f"<Calibration of {self.robots} robots from {len(self.trials)} recordings: {held}>"

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import calibration_html

        return calibration_html(self)

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values with units in the keys; see ``estimator.calibrate.json``."""
        return calibration_to_dict(self)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> list[str]:
        """Write all files that the docstring of this module lists into an existing folder.

        Args:
            folder: existing folder.
            pictures: whether to draw pictures.
            more: further keys of the JSON.

        Returns:
            One sentence per file that could not be made, with the reason.

        Raises:
            InputError: a file cannot be written.
        """
        from mocobot_sim.extended.extended import write_calibrated

        notes = []
        for k in range(len(self.payloads)):
            name = MODEL if len(self.payloads) == 1 else f"{MODEL}-{k + 1}"
            try:
                write_calibrated(self, folder / name, k)
            except InputError as error:  # impossible inertial parameters, or robots that cannot be simulated
                notes.append(f"there is no {name}: {error}")
        for robot in range(1, self.robots + 1):
            write_text(folder / f"omnid{robot}.toml", unit_toml(self, robot))
        if pictures and draws_plots():
            from mocobot_report.plots_calibration import save_plots

            save_plots(self, folder)
        write_json(folder / CALIBRATION, self.to_dict() | more)
        write_text(folder / REPORT, f"{self}\n")
        return notes


@dataclass(frozen=True, eq=False, repr=False)
class JointCalibration(Folder):
    """A single robot as its joint logs have it; prints as text, writes a folder.

    Attributes:
        found: parameters with standard errors, and torques or positions predicted for logs that were not fitted.
        drives: drives of logs whose torques no sensor measured; empty for others.
        map: text of the logs' map with the gains and delays that were found, empty if nothing of it was.
    """

    found: ArmCalibration
    drives: tuple[Drive, ...] = ()
    map: str = ""
    result = "calibration"

    def __str__(self) -> str:
        """Return the text report."""
        return calibrated.to_text(self.found)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        told = sum(p.determined for p in self.found.parameters)
        return f"<Calibration of {self.found.model.path.name}: {told} of {len(self.found.parameters)} parameters>"

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences on what casts doubt on the numbers."""
        return calibrated.findings(self.found)

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values with units in the keys; see ``discrepancy.joints.calibrated``."""
        return calibrated.to_dict(self.found)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> list[str]:
        """Write all files that the docstring of this module lists into an existing folder.

        Returns:
            One sentence per effect that ``as_found.xml`` cannot hold.

        Raises:
            InputError: a file cannot be written, or MuJoCo refuses the model.
        """
        as_given = calibrated.write_into(self.found, folder, self.drives, **more)
        if self.map:
            write_text(folder / "log.toml", self.map)
        if pictures and draws_plots():
            from mocobot_report.plots_calibration import save_left

            save_left(calibrated.from_dict(self.to_dict(), ""), folder)
        return as_given


@overload
def calibrate(
    logs: Given | Iterable[Given],
    model: None = None,
    free: Given | Iterable[Given] = (),
    options: CalibrateOptions | None = None,
    *,
    say: Say = quiet,
    note: Say = quiet,
    **fields: Any,
) -> Calibration: ...
@overload
def calibrate(
    logs: GivenLogs,
    model: GivenModel,
    free: Given | Iterable[Given] = (),
    options: CalibrateOptions | None = None,
    *,
    say: Say = quiet,
    note: Say = quiet,
    **fields: Any,
) -> JointCalibration: ...
def calibrate(
    logs: Any,
    model: GivenModel | None = None,
    free: Any = (),
    options: CalibrateOptions | None = None,
    *,
    say: Say = quiet,
    note: Say = quiet,
    **fields: Any,
) -> Calibration | JointCalibration:
    """Estimate how every robot differs from its model, and the payloads that a team carries.

    Args:
        logs: recordings of one team with payloads, or paths of recordings or of logs that ``convert`` reads without
            further options. With several, each can be predicted from the others. With a model, logs of its joints.
        model: single robot whose joints were logged, or path of its file; None for a team.
        free: recordings of the same robots without a payload, which determine the weight of the arms.
        options: options of the calibration; ``fields`` replace its fields. Labels and weights may be mappings, such as
            ``known_mass={"c": (10.48, 0.005)}`` [kg]; for a single payload, a number suffices.
        say: called with the name of each stage that begins.
        note: called with a text on how each log was read.

    Raises:
        InputError: a recording cannot be used, recordings do not belong together, or a weight has no payload.
    """
    chosen = made(CalibrateOptions, options, fields)
    chosen.check_for(model, free)
    if model is not None:
        from mocobot.api.joints import read_logs, read_model

        robot = read_model(model, lock=chosen.lock, base=chosen.base)
        say("reading")
        read_from = read_logs(logs, robot, map=chosen.map, episode=chosen.episode)
        drives = tuple(log.drive for log in read_from if log.by_command)
        found = calibrate_arm(robot, read_from, say, chosen.same)
        if found.predicts == "torque":
            return JointCalibration(found, drives if len(drives) == len(read_from) else ())
        return JointCalibration(found, drives, _found_map(found, logs, chosen.map))
    prior = chosen.prior
    assumed = prior if isinstance(prior, Prior) else Prior() if prior is None else read_prior(prior)
    if chosen.tilt and assumed.tilt_rad == 0:
        assumed = replace(assumed, tilt_rad=TILT_RAD)
    if chosen.arm_masses and assumed.arm_mass_ratio == 0:
        assumed = replace(assumed, arm_mass_ratio=ARM_MASS_RATIO)
    held, alone = (
        [given] if isinstance(given, Recording | Path | str) else list(given) for given in (logs, free)
    )
    labels, masses = _labels(chosen.payload_of or {}, held), _masses(chosen.known_mass)
    given = recordings_of([*held, *alone], chosen.map, episode=chosen.episode, say=say, note=note)
    read = list(given)
    carried = _labelled(read[: len(held)], labels)
    found = fit(carried, read[len(held) :], assumed, _weights(masses, carried), say)
    if chosen.parallel_flanges:
        say("flanges")
        found = in_drawing_frames(found)
    return public(Calibration, found)


def _found_map(found: ArmCalibration, logs: GivenLogs, given: Path | str | None) -> str:
    """Text of the first log's map with the delays, limits and roughly known gains found; empty without a file."""
    from mocobot.api.joints import map_path

    first = logs if isinstance(logs, Path | str | JointLog) else next(iter(logs))
    if isinstance(first, JointLog):
        return ""
    path, values = (
        map_path(found.model, Path(first), given),
        {(p.place, p.name): p.value for p in found.parameters},
    )
    numbers = {
        "delay_s": {place: max(x, 0.0) for (place, name), x in values.items() if name == "command_delay_s"}
    }
    gains = {place: x for (place, name), x in values.items() if name.startswith("position_gain_")}
    if len(gains) == len(found.joints):
        numbers["position_gain"] = gains
    if found.servos is not None and any(name.startswith("limit_") for _, name in values):
        scale = [1.0 + values.get((place, "gain"), 0.0) for place in found.model.joints]
        most = dict(zip(found.model.joints, found.servos[:, 3] * scale, strict=True))
        if np.isfinite([*most.values()]).all():
            numbers["limit"] = most
    return with_control(path.read_text(encoding="utf-8"), numbers) or ""


def read_calibration(path: Path | str) -> Calibration:
    """Read a calibration, from the JSON file or the folder of ``Calibration.write`` or ``mocobot calibrate --out``.

    Raises:
        InputError: the file cannot be read or is not a complete calibration.
    """
    return public(Calibration, calibration_of(path))


def _labels(given: Mapping[str, str] | Iterable[str], logs: Sequence[Given]) -> dict[str, str]:
    """Map recording names to payload labels, from a mapping or from texts ``REC=LABEL``."""
    if isinstance(given, Mapping):
        return dict(given)
    names = [log.name if isinstance(log, Recording) else str(log) for log in logs]
    out: dict[str, str] = {}
    for entry in given:
        name, equals, label = entry.rpartition("=")
        known = next((one for one in names if name and name in (one, Path(one).name)), None)
        if not equals or not label or known is None:
            raise InputError(
                f"payload_of is {entry!r}; it must be REC=LABEL with one of the recordings {', '.join(names)}"
            )
        if known in out:
            raise InputError(f"payload_of names {known} twice")
        out[known] = label
    return out


def _labelled(recordings: Sequence[Recording], labels: Mapping[str, str]) -> list[Recording]:
    """Replace the payload labels of recordings; ``labels`` may omit the folder of a recording's name."""
    out, unmet = [], dict(labels)
    for recording in recordings:
        name = next((n for n in (recording.name, Path(recording.name).name) if n in labels), None)
        if name is not None:
            unmet.pop(name, None)
            recording = replace(recording, metadata=replace(recording.metadata, payload=labels[name]))
        out.append(recording)
    for name in unmet:
        there = ", ".join(recording.name for recording in recordings)
        raise InputError(f"payload of {name}: no such recording is given; there are {there}")
    return out


def _masses(given: Mapping[str, Weight] | Weight | Iterable[str]) -> dict[str, Weight]:
    """Map payload labels to a mass, or to mass and standard error [kg]; "" stands for the only payload."""
    if isinstance(given, Mapping):
        return dict(given)
    if isinstance(given, float | int):
        return {"": given}
    out: dict[str, Weight] = {}
    for entry in map(str, given or ()):
        label, _, rest = entry.rpartition("=")
        number, plus_minus, error = rest.partition("+-")
        try:
            mass = float(number)
            se = float(error) if plus_minus else WEIGHED * mass
        except ValueError:
            mass = se = float("nan")
        if not (0 < mass < 1e6 and 0 < se < 1e6):
            raise InputError(
                f"known_mass is {entry!r}; it must be [LABEL=]KG or [LABEL=]KG+-SE with numbers greater than 0, such "
                "as c=10.48+-0.005"
            )
        if label in out:
            raise InputError(f"known_mass names payload {label!r} twice")
        out[label] = mass, se
    return out


def _weights(known: Mapping[str, Weight], recordings: Sequence[Recording]) -> dict[str, tuple[float, float]]:
    """Map the payload labels of the recordings to mass and standard error [kg]."""
    labels = {recording.metadata.payload or "" for recording in recordings}
    out = {}
    for label, given in known.items():
        if label == "" and "" not in labels:
            if len(labels) > 1:
                raise InputError(
                    f"known mass of {given} kg: say of which payload; there are {', '.join(sorted(labels))}"
                )
            label = next(iter(labels), "")
        mass, se = given if isinstance(given, tuple) else (given, WEIGHED * given)
        if label in out:
            raise InputError(f"known mass of payload {label!r} is given twice")
        out[label] = float(mass), float(se)
    return out
