"""The command to type after a diagnosis, with the user's own files filled in."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping
from itertools import chain, count
from pathlib import Path
from typing import Any

from discrepancy.result.read import EXTENDED, NAME
from mocobot.options import Calibrate, Diagnose, Watch

CALIBRATED, AS_FOUND, MAP, NEW = Path("calibrated"), "as_found.xml", "log.toml", "NEW"
"""Folder of the suggested calibration, its model and map, and name of a log that the user still has to record."""
KEPT = ("model", "map", "calibration", "tolerances", "exclude", "reference")
"""Options of a diagnosis that the next one needs, too."""


def next_step(options: Diagnose | Watch, values: Mapping[str, Any]) -> str:
    """Return two lines, the purpose of the next command and that command; empty if there is none.

    Args:
        options: options of the diagnosis.
        values: its JSON values.
    """
    purpose, command = _next(options, values)
    return f"\nNext, {purpose}:\n    {command}\n" if command else ""


def after_calibration(options: Calibrate) -> str:
    """Return two lines: try the model of a calibrated robot on a log that it was not fitted to."""
    assert options.out is not None
    new = _free(options.rec[0].with_name(f"{NEW}{options.rec[0].suffix}"))
    found = options.out / MAP
    map_ = ["--map", found] if found.is_file() else [] if options.map is None else ["--map", options.map]
    command = command_line(["diagnose", new, "--model", options.out / AS_FOUND, *map_])
    return f"\nNext, log another motion as {new}, and see what is left to explain:\n    {command}"


def _next(options: Diagnose | Watch, values: Mapping[str, Any]) -> tuple[str, str]:
    verdict, causes, logs = values["verdict"], values["causes"], options.rec
    arm, reference = options.model is not None, getattr(options, "reference", ())
    new = _free(options.rec[0].with_name(f"{NEW}{options.rec[0].suffix}"))
    if not values["finished"]:
        return "let the search come to its end", _diagnose(options, logs)
    if any(len(cause["told"]) > 1 and cause["separate"] for cause in causes):
        return f"record what decides as {new}, and diagnose again", _diagnose(options, [*logs, new])
    if reference:
        purpose = f"after the repair, log the same motion as {new}, and see that the change is gone"
        return (purpose, _diagnose(options, [new])) if causes else ("", "")
    if any(cause["cause"] != "unlisted" and not cause["event"] for cause in causes):
        if arm:
            return "fit the model to these logs", _calibrate(options)
        if options.out is not None and (options.out / EXTENDED).is_dir():
            simulated = _free(options.out.with_name(f"{options.out.name}-simulated.parquet"))
            command = ["simulate", "--model", options.out / EXTENDED, "--out", simulated]
            return "simulate the team with these findings in it", command_line(command)
    elif unlisted := [cause for cause in causes if cause["separate"] and not cause["event"]]:
        experiment = unlisted[0]["separate"].rstrip(".")
        purpose = f"at {unlisted[0]['place']}: {experiment[:1].lower()}{experiment[1:]}; log it as {new}, and"
        return f"{purpose} diagnose again", _diagnose(options, [*logs, new])
    elif verdict == "miscalibrated" and getattr(options, "calibration", None) is None:
        return f"find the {'robot' if arm else 'robots'} as built", _calibrate(options)
    elif verdict == "unexplained" and options.out is not None:
        return "look where it is off", command_line(["report", options.out])
    elif verdict == "consistent" and arm:
        return _of_a_clean_arm(options, new)
    return "", ""


def _of_a_clean_arm(options: Diagnose | Watch, new: Path) -> tuple[str, str]:
    """Compare with the diagnosis that wrote this model; for any other model, keep these logs as the reference."""
    assert options.model is not None
    earlier = options.model.parent.parent
    if options.out is not None and options.model.parent.name == EXTENDED and (earlier / NAME).is_file():
        return "compare with the verdict before", command_line(["compare", earlier, options.out])
    command = _diagnose(options, [new], options.rec)
    return f"log the same motion next week as {new}, and see what has changed", command


def _calibrate(options: Diagnose | Watch) -> str:
    return command_line(
        ["calibrate", *options.rec, *_options(options, ("model", "map")), "--out", _free(CALIBRATED)]
    )


def _diagnose(options: Diagnose | Watch, logs: Iterable[Path], reference: Iterable[Path] = ()) -> str:
    out = [] if options.out is None else ["--out", _free(options.out)]
    given = [*reference]
    return command_line(
        ["diagnose", *logs, *_options(options, KEPT), *(["--reference", *given] if given else []), *out]
    )


def _options(options: Diagnose | Watch, names: Iterable[str]) -> list[Any]:
    """Return the words of those options that are given."""
    given = {name: value for name in names if (value := getattr(options, name, None)) not in (None, ())}
    each = ((f"--{name}", value if isinstance(value, tuple) else (value,)) for name, value in given.items())
    return [word for name, several in each for word in (name, *several)]


def _free(path: Path) -> Path:
    """Return the path, or the first of ``NAME-2``, ``NAME-3``, ... that does not exist."""
    stem = re.sub("-[0-9]+$", "", path.stem)
    numbered = (path.with_name(f"{stem}-{k}{path.suffix}") for k in count(2))
    return next(each for each in chain([path], numbered) if not each.exists())


def command_line(words: Iterable[Any]) -> str:
    """Return a command as a shell takes it."""
    return shlex.join(["mocobot", *map(str, words)])
