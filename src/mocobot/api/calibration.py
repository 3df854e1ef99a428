"""Calibrate the robots of a team from what they carry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.calibrate.calibrate import calibrate as fit
from estimator.calibrate.calibration import Calibration as Below
from estimator.calibrate.calibration import Prior, read_prior
from estimator.calibrate.flanges import in_drawing_frames
from estimator.calibrate.json import calibration_to_dict
from estimator.calibrate.text import format_calibration
from estimator.errors import InputError
from estimator.files import holds, whole_folder
from estimator.recording.model import Recording
from mocobot.api.given import Given, recordings_of
from mocobot.api.public import public
from mocobot.files import calibrations
from mocobot.files.targets import check_folder

TILT_RAD, ARM_MASS_RATIO = float(np.deg2rad(0.2)), 0.1
"""Standard deviations of what is free on demand only, where the prior has none."""
WEIGHED = 1e-3
"""Relative standard error of a weight that is given without one."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Below):
    """The robots as they are and what they carry, printable, a table in a notebook, and a folder of files.

    The attributes are those of ``estimator.calibrate.calibration.Calibration``.
    """

    def __str__(self) -> str:
        """The text report."""
        return format_calibration(self)

    def __repr__(self) -> str:
        """One line."""
        held = ", ".join(f"{payload.parameters[0]:.4g} kg" for payload in self.payloads)
        return f"<Calibration of {self.robots} robots from {len(self.trials)} recordings: {held}>"

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import calibration_html

        return calibration_html(self)

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``estimator.calibrate.json``."""
        return calibration_to_dict(self)

    def write(self, folder: Path | str) -> None:
        """Write JSON, report, every robot's numbers, pictures and the team's model; an earlier calibration is replaced.

        ``mocobot report`` makes a page of the folder; ``simulate`` takes its ``model``.

        Raises:
            InputError: the folder holds something else, or cannot be written.
        """
        check_folder(Path(folder), [], holds("calibration"), "an earlier calibration", force=True)
        with whole_folder(Path(folder), "calibration") as whole:
            calibrations.write_into(whole, self)


def calibrate(
    recordings: Given | Iterable[Given],
    *,
    free: Given | Iterable[Given] = (),
    map: Path | str | None = None,
    prior: Prior | Path | str | None = None,
    payload_of: Mapping[str, str] | None = None,
    known_mass: Mapping[str, float | tuple[float, float]] | float | None = None,
    parallel_flanges: bool = False,
    tilt: bool = False,
    arm_masses: bool = False,
    say: Callable[[str], object] = lambda _: None,
) -> Calibration:
    """Find out how every robot differs from its design, and what the team carries.

    Args:
        recordings: of one team with payloads, or paths of their files, or of logs that ``convert`` reads as they are;
            several, so that each can be foretold by the others.
        free: the same of the robots with nothing in their hands, which tell what the arms weigh.
        map: map of those logs, by file or built-in name (docs/measured-data.md); found out if not given.
        prior: how far the robots may be off, or the TOML file that says so; None for robots out of the box.
        payload_of: labels of payloads by a recording's name, in place of what its metadata says.
        known_mass: weighed payloads by label, mass or (mass, standard error) [kg]; a number alone where there is one
            payload. 0.1 % if no standard error is given. One decides the springs' common scale.
        parallel_flanges: the z axes of all flanges are parallel; decides the zeros of theta_x, and results are in the
            frames of drawings.
        tilt: bases may not stand level (0.2 deg, where the prior says nothing).
        arm_masses: each arm's masses may be off (10 %, where the prior says nothing).
        say: takes the name of the stage that begins.

    Raises:
        InputError: recordings that cannot be used or do not belong together, or a weight of no payload.
    """
    assumed = prior if isinstance(prior, Prior) else Prior() if prior is None else read_prior(prior)
    if tilt and assumed.tilt_rad == 0:
        assumed = replace(assumed, tilt_rad=TILT_RAD)
    if arm_masses and assumed.arm_mass_ratio == 0:
        assumed = replace(assumed, arm_mass_ratio=ARM_MASS_RATIO)
    say("reading")
    read, alone = _read(recordings, free, map)
    read = _labelled(read, payload_of or {})
    found = fit(read, alone, assumed, _weights(known_mass, read), say)
    if parallel_flanges:
        say("flanges")
        found = in_drawing_frames(found)
    return public(Calibration, found)


def read_calibration(path: Path | str) -> Calibration:
    """Read what ``Calibration.write`` or ``mocobot calibrate --out`` wrote: the file, or its folder.

    Raises:
        InputError: the file cannot be read, or is not a whole calibration.
    """
    return public(Calibration, calibrations.read_calibration(path))


def _read(
    recordings: Given | Iterable[Given], free: Given | Iterable[Given], map: Path | str | None
) -> tuple[list[Recording], list[Recording]]:
    """Both kinds, for which a map may be of use together."""
    each, alone = (
        [given] if isinstance(given, Recording | Path | str) else list(given) for given in (recordings, free)
    )
    read = list(recordings_of([*each, *alone], map))
    return read[: len(each)], read[len(each) :]


def _labelled(recordings: Sequence[Recording], labels: Mapping[str, str]) -> list[Recording]:
    """Recordings with labels of their own; a name may come without its folder."""
    out, names = [], dict.fromkeys(labels, False)
    for recording in recordings:
        name = next((n for n in (recording.name, Path(recording.name).name) if n in labels), None)
        if name is None:
            out.append(recording)
            continue
        names[name] = True
        out.append(replace(recording, metadata=replace(recording.metadata, payload=labels[name])))
    for name, met in names.items():
        if not met:
            raise InputError(
                f"payload of {name}: no such recording is given; there are "
                f"{', '.join(recording.name for recording in recordings)}"
            )
    return out


def _weights(
    known: Mapping[str, float | tuple[float, float]] | float | None, recordings: Sequence[Recording]
) -> dict[str, tuple[float, float]]:
    """Masses with standard errors by label, "" for none."""
    if known is None:
        return {}
    if not isinstance(known, Mapping):
        known = {"": known}
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
