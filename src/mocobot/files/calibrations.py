"""Calibrations as files: what ``mocobot calibrate`` writes and other commands take.

calibration.json           see ``estimator.calibrate.json``
report.txt                 what the command prints
omnid1.toml ...            every robot's numbers as they are
model, or model-1 ...      the calibrated team in MuJoCo, one for each payload; ``mocobot simulate --model`` takes it
deviations.png, recordings.png, shares.png
                           parameters against priors, what recordings leave over, what each of them contributes
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.calibrate.calibration import Calibration
from estimator.calibrate.json import calibration_from_dict, calibration_to_dict
from estimator.calibrate.text import format_calibration, unit_toml
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.strict import read_json
from mocobot.files.targets import CALIBRATION as NAME

REPORT, MODEL = "report.txt", "model"


def read_calibration(path: Path | str) -> Calibration:
    """Read a calibration.

    Args:
        path: its file, or the folder that ``mocobot calibrate --out`` wrote.

    Raises:
        InputError: the file cannot be read, or is not a whole calibration.
    """
    path = Path(path)
    file = path / NAME if path.is_dir() else path
    return calibration_from_dict(read_json(file, "a calibration"), str(file))


def write_calibration(
    path: Path, calibration: Calibration, made_with: Mapping[str, Any] | None = None
) -> None:
    """Write a calibration; the file appears whole or not at all.

    Args:
        path: the file.
        calibration: to be written.
        made_with: what ``mocobot.files.provenance.provenance`` says, or None.

    Raises:
        InputError: it cannot be written.
    """
    more = {} if made_with is None else {"provenance": dict(made_with)}
    write_json(path, calibration_to_dict(calibration) | more)


def write_into(
    folder: Path, calibration: Calibration, made_with: Mapping[str, Any] | None = None
) -> list[str]:
    """Write everything that is listed at the head of this module into an existing folder.

    Returns:
        What could not be made, and why, one sentence each.

    Raises:
        InputError: something cannot be written.
    """
    # MuJoCo, which reading does not need
    from mocobot_sim.extended.extended import write_calibrated

    notes = []
    for k in range(len(calibration.payloads)):
        name = MODEL if len(calibration.payloads) == 1 else f"{MODEL}-{k + 1}"
        try:
            write_calibrated(calibration, folder / name, k)
        except InputError as error:  # numbers that no body has, robots that are not the simulated ones
            notes.append(f"there is no {name}: {error}")
    for robot in range(1, calibration.robots + 1):
        write_text(folder / f"omnid{robot}.toml", unit_toml(calibration, robot))
    if draws_plots():
        from mocobot_report.plots_calibration import save_plots  # matplotlib, which reading does not need

        save_plots(calibration, folder)
    write_calibration(folder / NAME, calibration, made_with)
    write_text(folder / REPORT, f"{format_calibration(calibration)}\n")
    return notes
