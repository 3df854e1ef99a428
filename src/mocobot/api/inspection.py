"""Look at a log before anyone trusts a number of it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from estimator.arm.design import OmnidDesign, load_design
from mocobot.api.given import GivenCalibration, Robots
from mocobot.api.look import Look
from mocobot.api.public import public
from mocobot_inspect import team as inspection
from mocobot_inspect.findings import findings
from mocobot_inspect.report import format_inspection, inspection_dict, ready_line
from mocobot_logs.map.files import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Look, inspection.Inspection):
    """Stamps, channels, clocks, wiring and excitation of a log: printable, and a table in a notebook.

    The attributes are those of ``mocobot_inspect.team.Inspection``; ``mocobot_inspect.report`` has the JSON's keys.
    """

    _findings, _ready_line = findings, ready_line
    _text, _dict = format_inspection, inspection_dict

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import inspection_html

        return inspection_html(self.to_dict())


def inspect(
    log: Path | str,
    *,
    map: Path | str | None = None,
    design: OmnidDesign | Path | str | None = None,
    calibration: GivenCalibration | None = None,
    episode: int | None = None,
    advance: Callable[[int], object] = lambda _: None,
) -> Inspection:
    """Look at a log; whatever is wrong with its samples is reported and not refused.

    Args:
        log: a recording, or a log of any format that ``convert`` reads.
        map: map file, or name of a built-in map (docs/measured-data.md); found out if not given.
        design: numbers of the robots, or a TOML file of them, where the log does not say; None for the Omnid's.
        calibration: the robots as they are, or its file; None for what the log says of them.
        episode: of a LeRobot dataset that holds several.
        advance: takes the progress made in reading, in the log's units.

    Raises:
        InputError: the log, map, design or calibration cannot be read, or that is of other robots.
    """
    robots = Robots(calibration)
    log_map = read_map(str(map)) if map is not None else None
    standard = load_design(Path(design)) if isinstance(design, Path | str) else design or omnid_design()
    source = open_log(Path(log), log_map, episode)
    units = robots.units(source, standard)
    trial = log_map.trial if log_map is not None else None
    return public(Inspection, inspection.inspect_log(source, standard, advance, trial=trial, units=units))
