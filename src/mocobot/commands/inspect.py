"""``mocobot inspect``: a look at a log before anyone trusts a number from it."""

from pathlib import Path

from estimator.arm.design import load_design
from estimator.files import write_json
from mocobot.api.given import Robots
from mocobot.options import Inspect
from mocobot.progress import bar
from mocobot.strict import NotGood
from mocobot_inspect.report import format_inspection, inspection_dict, ready_line
from mocobot_inspect.team import inspect_log
from mocobot_logs.map.files import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design


def run(options: Inspect) -> None:
    """Run the command; without ``strict`` it ends well whatever is found.

    Raises:
        NotGood: with ``strict``, the log is ready for nothing.
        InputError: the log, map or design cannot be read, or the JSON cannot be written.
    """
    if options.model is not None:
        _run_joints(options, options.model)
        return
    log_map = read_map(options.map) if options.map is not None else None
    design = load_design(options.design) if options.design is not None else omnid_design()
    robots = Robots(options.calibration)
    source = open_log(Path(options.rec), log_map, options.episode)
    units = robots.units(source, design)
    with bar(source.size, "reading", "") as advance, bar(None, "checking", "mistake") as try_advance:
        trial = log_map.trial if log_map is not None else None
        found = inspect_log(source, design, advance, try_advance, trial, units)
    if options.json is not None:
        write_json(options.json, inspection_dict(found))
    print(format_inspection(found))
    ready = ready_line(found)
    if options.strict and (ready.startswith("ready for: nothing") or " yes" not in ready):
        raise NotGood(ready)


def _run_joints(options: Inspect, model: Path) -> None:
    """A log of one robot's joints, judged by its model."""
    from mocobot import serial

    robot = serial.read_model(model)
    with bar(None, "reading", "") as advance, bar(None, "checking", "mistake") as tried:
        found = serial.inspect(
            options.rec, robot, map=options.map, episode=options.episode, advance=advance, tried=tried
        )
    if options.json is not None:
        found.write(options.json)
    print(found)
    if options.strict and found.ready_for.startswith("ready for: nothing"):
        raise NotGood(found.ready_for)
