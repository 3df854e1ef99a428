"""``mocobot diagnose --model``: logs of one robot's joints against its MJCF or URDF."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path

from estimator.files import whole_folder
from mocobot import serial
from mocobot.files.provenance import provenance
from mocobot.options import Diagnose
from mocobot.progress import bar, stages
from mocobot.strict import NotGood


def run(options: Diagnose, model: Path) -> None:
    """Run the command.

    Args:
        options: of the command.
        model: the robot's file.

    Raises:
        InputError: model, map, logs, tolerances or options that cannot be used, or an output that cannot be written.
        NotGood: with ``strict``, the verdict is neither consistent nor explained.
    """
    robot = serial.read_model(model)
    maps = {serial.map_path(robot, log, options.map) for log in (*options.rec, *options.reference)}
    inputs = [model, *sorted(maps), *options.rec, *options.reference]
    inputs += [options.tolerances] if options.tolerances else []
    tolerances = serial.serial_tolerances(options.tolerances)
    with whole_folder(options.out, "diagnosis") if options.out else nullcontext() as folder:
        with bar(len(options.rec) + len(options.reference), "reading", "file") as advance:
            logs = serial.read_logs(options.rec, robot, map=options.map, advance=advance)
            reference = serial.read_logs(options.reference, robot, map=options.map, advance=advance)
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        with stages() as (say, _):
            found = serial.diagnosed(
                robot, logs, reference, tolerances, options.exclude,
                closed_loop=options.closed_loop, seconds=options.seconds, say=say,
            )  # fmt: skip
            if folder is not None:
                say("write")
                found.write_into(folder, provenance=made_with)
    # After the folder is in place: whoever reads may close the pipe.
    print(found.verbose_text() if options.verbose else found)
    if options.out:
        print(f"\nWritten to {options.out}.")
    verdict = found.to_dict()["verdict"]
    if options.strict and verdict not in ("consistent", "explained"):
        raise NotGood(f"the verdict is {verdict.replace('_', ' ')}")
