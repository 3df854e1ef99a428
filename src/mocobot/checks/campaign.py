"""What ``mocobot campaign`` refuses at once."""

import math
from pathlib import Path

from estimator.errors import InputError
from estimator.files import check_place
from mocobot.api.fits import check_fits
from mocobot.campaign.folder import is_campaign
from mocobot.files.targets import calibration_file, check_folder, check_no_input, check_there
from mocobot.options import Campaign
from mocobot_sim.scene.model_files import payload_path

KINDS = ("random", "periodic", "static")


def check(options: Campaign) -> None:
    """Everything that can be refused before a team is built, but for the names of causes and of sensors.

    Raises:
        InputError: an option or an output that cannot be met.
    """
    kinds = kinds_of(options)
    check_fits("--vias", options.vias, ("random",), kinds)
    check_fits("--duration", options.duration, ("periodic",), kinds)
    for name, least in (("jobs", 1), ("teams", 1), ("sets", 0), ("seed", 0)):
        if getattr(options, name) < least:
            raise InputError(f"--{name} is {getattr(options, name)}; it must be at least {least}")
    if not options.background:
        raise InputError("--background names no robots; it must be calibrated, uncalibrated or both")
    if len(set(options.background)) < len(options.background):
        raise InputError(f"--background {' '.join(options.background)} names the same robots twice")
    if not options.sizes or not all(0.0 < size < math.inf for size in options.sizes):
        raise InputError(f"--sizes is {options.sizes}; they must be numbers above 0")
    if options.calibration is not None and options.units is None:
        raise InputError("--calibration is of given robots; say with --units how they truly are")
    inputs = inputs_of(options)
    check_there(inputs)
    if Path(options.payload).suffix != ".xml":
        payload_path(options.payload)
    if is_campaign(options.out):
        check_no_input(options.out, inputs)
        check_place(options.out)
    else:
        check_folder(options.out, inputs, lambda _: False, "a campaign", force=options.force)


def kinds_of(options: Campaign) -> tuple[str, ...]:
    """Kind of every trial.

    Raises:
        InputError: one is of no known kind.
    """
    kinds = tuple(options.trials.split(","))
    for kind in kinds:
        if kind not in KINDS:
            raise InputError(
                f"--trials is {options.trials!r}; it must be a list such as random,random,periodic,static of "
                f"{', '.join(KINDS)}"
            )
    return kinds


def inputs_of(options: Campaign) -> list[Path]:
    """Files that are read."""
    given = Path(options.payload)
    named = [given if given.suffix == ".xml" else None, options.units, options.tolerances]
    return [path for path in named if path is not None] + calibration_file(options.calibration)
