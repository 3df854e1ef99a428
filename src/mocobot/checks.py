"""Checks of each command before it loads numpy, MuJoCo or other slow modules: ``check_`` and the command's name.

Options check themselves (``mocobot.options``); this module checks files to read and places to write. No command
overwrites anything without ``--force``. With it, a command replaces a file, or a folder that holds only an earlier
result of the same command. No command replaces an input.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mocobot_report as sought
from estimator.errors import InputError
from estimator.files import check_place, check_target, holds, system_errors
from estimator.strict import read_json
from mocobot import options as opt
from mocobot_logs.formats import PARQUET as MAGIC
from mocobot_logs.formats import log_kind, output_kind
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.scene.models import payload_path, truth_path

CALIBRATION = "calibration.json"
"""Name of the JSON file that ``mocobot calibrate --out`` writes into its folder."""
CONFIG, CONFIG_FORMAT = "config.json", "mocobot-campaign-config"
"""File that marks the folder of a campaign, and its format."""
SCORES, PARTIAL = "paper.json", "partial"
"""In the folder of ``mocobot paper --out``: the file of scores, and the subfolder of an unfinished run."""
TRUTH = "the truth beside a simulated recording"
LEAST_BYTES = 12
"""Smallest size of a Parquet file [bytes]. Derived: 4 bytes of magic at each end, 4 for the length of the footer."""


INPUTS = {
    opt.Inspect: ("rec", "calibration", "model", "map"),
    opt.Map: ("log", "model"),
    opt.Convert: ("log", "design", "map"),
    opt.Estimate: ("rec", "map", "calibration"),
    opt.Calibrate: ("rec", "free", "prior", "model", "map"),
    opt.Watch: ("rec", "reference", "model", "map"),
    opt.Diagnose: ("rec", "reference", "tolerances", "model", "map", "calibration"),
    opt.Compare: ("a", "b"),
    opt.Simulate: ("payload", "units"),
    opt.CampaignOptions: ("payload", "units", "tolerances", "calibration"),
    opt.Replay: ("rec", "estimate", "model", "map", "calibration"),
}
"""Options that name the input files of each command, in the order in which its provenance lists them."""


def inputs_of(options: Any) -> list[Path]:
    """List the files and folders that the options of a command name as inputs."""
    found: list[Path] = []
    for name in next(INPUTS[kind] for kind in type(options).__mro__ if kind in INPUTS):
        value = getattr(options, name)
        if value is None:
            continue
        if name == "map":
            found += map_file(value)
        elif name == "payload":
            found += [Path(value)] if value.endswith(".xml") else []
        elif name == "calibration" and value.is_dir():
            found.append(value / CALIBRATION)
        else:
            found += value if isinstance(value, tuple) else [value]
    return found


def map_file(name: str) -> list[Path]:
    """Return the file of a map in a list, which is empty for a built-in map."""
    if not Path(name).is_file():
        return []
    from mocobot_logs.maps import MAPS

    return [] if name in MAPS else [Path(name)]


def check_inspect(options: opt.Inspect) -> None:
    """Check the options and files of ``inspect`` before the log is read."""
    options.check_for(options.model)
    _check_file(options, options.json)
    _check_logs([options.rec], options.model)


def check_map(options: opt.Map) -> None:
    """Check the options and files of ``map`` before the log is read."""
    _check_file(options, options.out)
    _check_logs([options.log], options.model)


def check_convert(options: opt.Convert) -> None:
    """Check the options and files of ``convert`` before the log is read."""
    options.check()
    check_target_of(options, targets(options.out, 1)[0] if options.split_at_gaps else options.out)
    if options.json is not None:
        check_output(options.json, [*inputs_of(options), options.out], force=options.force)
    _check_logs([options.log])


def targets(out: Path, count: int) -> list[Path]:
    """Make the numbered paths for the parts of a log."""
    width = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{width}}{out.suffix}") for k in range(1, count + 1)]


def check_target_of(options: opt.Convert, out: Path) -> None:
    """Check that ``convert`` may write one recording to the path ``out``."""
    inputs = inputs_of(options)
    if output_kind(out) == "folder":
        check_no_input(out, inputs)
        check_folder(out, inputs, holds("bag"), "a bag of an earlier conversion", force=options.force)
    else:
        check_output(out, inputs, force=options.force)


def check_estimate(options: opt.Estimate) -> None:
    """Check the options and files of ``estimate`` before a recording is read."""
    options.check()
    _check_recordings(options.rec)
    if options.pictures:
        _check_folder(options, "estimate")
    else:
        _check_file(options, options.out)
    _check_file(options, options.json)
    _check_logs(options.rec)


def check_calibrate(options: opt.Calibrate) -> None:
    """Check the options and files of ``calibrate`` before a recording is read."""
    if not options.rec and options.model is not None:
        raise InputError("no log is given; name the logs of the robot's joints first, --model after them")
    if not options.rec:
        raise InputError("no recording with a payload is given; name them first, those of --free after it")
    options.check_for(options.model, options.free)
    files = [*options.rec, *options.free]
    _check_recordings(files)
    _check_folder(options, "calibration")
    _check_file(options, options.json)
    _check_logs(files, options.model)


def check_watch(options: opt.Watch) -> None:
    """Check the options and files of ``watch`` before a log is read."""
    options.check()
    if options.model is None and (options.reference or options.follow):
        raise InputError(
            f"{'reference' if options.reference else 'follow'} goes with a model: a single robot's"
        )
    if options.follow and (options.out is not None or options.open):
        both = f"follow and {'out' if options.out is not None else 'open'} are both given"
        raise InputError(f"{both}; follow prints verdicts, and diagnose --out keeps that of a log")
    _check_recordings(options.rec)
    _check_recordings([*options.rec, *options.reference])
    stems = [path.stem for path in options.rec] if options.model is None else []
    for stem in stems:
        if stems.count(stem) > 1:
            raise InputError(f"{stem} is the name of two recordings; give each a name of its own")
    _check_folder(options, "watch", "an earlier result of watch")
    _check_logs([*options.rec, *options.reference], options.model)


def check_diagnose(options: opt.Diagnose) -> None:
    """Check the options and files of ``diagnose`` before a recording is read."""
    if not options.rec and options.exclude:
        raise InputError("no recording given; name them before --exclude")
    options.check()
    logs = [*options.rec, *options.reference]
    _check_recordings(options.rec)
    options.check_for(options.model, options.reference)
    _check_recordings(logs)
    _check_folder(options, "diagnosis")
    _check_file(options, options.json)
    _check_logs(logs, options.model)
    for path in filter(Path.exists, map(truth_path, options.rec)) if options.model is None else ():
        read_json(path, TRUTH)  # checks only that the file is readable


def check_compare(options: opt.Compare) -> None:
    """Check the options and files of ``compare`` before a result is read."""
    _check_folder(options, "comparison")
    _check_file(options, options.json)
    _check_there([options.a, options.b])


def check_simulate(options: opt.Simulate) -> None:
    """Check the options and files of ``simulate``, including the effects' parameters, before a team is built."""
    out = options.out
    if out is None:
        raise InputError(
            "out must be given: REC.parquet, or with --trials a folder; see mocobot simulate --help"
        )
    kinds = options.kinds
    if options.trials is None:
        _check_file(options, out, suffix=".parquet")
        _check_file(options, truth_path(out))
    elif out.suffix == ".parquet":
        raise InputError(f"out is {out}; with --trials it must be a folder")
    else:
        _check_folder(options, "simulation")
    options.check_for(options.payload, kinds)
    options.check()
    _check_payload(options.payload)
    if options.effects:
        from mocobot_sim.effects.catalogue import parse_effect

        for text in options.effects:
            parse_effect(str(text))


def _check_payload(payload: str | None) -> None:
    if payload is not None and not payload.endswith(".xml"):
        payload_path(payload)


def check_effects(options: opt.Effects) -> None:
    """Check that the named effects exist."""
    for name in options.name:
        check_effect_name(name)


def check_example(options: opt.Example) -> None:
    """Check that the folder of ``example`` may be written."""
    check_folder(options.out, (), holds("example"), "an earlier example", force=options.force)


def check_campaign(options: opt.Campaign) -> None:
    """Check the options and files of ``campaign`` before a team is built; sensor names are checked later."""
    options.check()
    inputs = inputs_of(options)
    _check_there(inputs)
    _check_payload(options.payload)
    if is_campaign(options.out):
        check_no_input(options.out, inputs)
        check_place(options.out)
    else:
        check_folder(options.out, inputs, lambda _: False, "a campaign", force=options.force)
    _check_file(options, options.json)


def is_campaign(folder: Path) -> bool:
    """Whether a folder holds a campaign, finished or not."""
    try:
        return read_json(folder / CONFIG, "what a campaign is of").get("format") == CONFIG_FORMAT
    except InputError:
        return False


def check_paper(options: opt.Paper) -> None:
    """Check the options and files of ``paper`` before the experiment is planned."""
    options.check()
    if options.recordings and not options.out:
        raise InputError("recordings needs --out")
    if options.out and _is_interrupted(options.out):
        check_place(options.out)
    elif options.out:
        has_scores: Callable[[Path], bool] = lambda folder: (folder / SCORES).is_file()  # noqa: E731
        check_folder(options.out, [], has_scores, "an earlier experiment", force=options.force)


def _is_interrupted(folder: Path) -> bool:
    """Whether a folder holds the partial results of a run, alone or beside final results.

    The command itself checks whether the partial results belong to the same run.
    """
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    return names == {PARTIAL} or names >= {PARTIAL, SCORES}


def check_report(options: opt.Report) -> None:
    """Check that the folder of ``report`` exists and that the page may be written."""
    if options.dir.is_file() and options.dir.suffix != ".json":
        return  # the command itself reports what kind of file it is
    sought.check_folder(options.dir)
    check_output(options.out or options.dir / sought.NAME, force=options.force, suffix=sought.SUFFIX)


def check_replay(options: opt.Replay) -> None:
    """Check the options and files of ``replay`` before a recording is read."""
    options.check_for(options.out, options.model)
    _check_recordings(options.rec)
    _check_file(options, options.out, suffix=".rrd")
    _check_logs(options.rec, options.model)


def _check_recordings(recordings: Sequence[Path]) -> None:
    """Check that at least one recording is given, and none twice."""
    if not recordings:
        raise InputError("no recording given; name at least one file")
    seen: set[str] = set()
    for path in recordings:
        real = os.path.realpath(path)
        if real in seen:
            raise InputError(f"{path} is given twice, and would count twice")
        seen.add(real)


def _check_logs(logs: Sequence[Path], *beside: Path | None) -> None:
    """Check that logs and further files exist, and that the logs have a known format."""
    _check_there([*logs, *(path for path in beside if path is not None)])
    for path in logs:
        if path.is_file() and path.suffix.lower() not in (".json", ".parquet"):  # their readers check
            log_kind(path)


def _check_there(paths: Sequence[Path]) -> None:
    """Refuse paths that do not exist and truncated Parquet files; the readers report all other faults."""
    for path in paths:
        try:
            path.stat()
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: there is no such file") from None
        except (OSError, ValueError):
            continue
        if path.is_file():
            _check_parquet(path)


def _check_parquet(path: Path) -> None:
    """Refuse an empty or truncated Parquet file; files of other formats pass."""
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC))
            size = file.seek(0, os.SEEK_END)
            file.seek(-min(size, len(MAGIC)), os.SEEK_END)
            end = file.read()
    except (OSError, ValueError):
        return  # a folder or an unreadable file: the reader reports it
    if head != MAGIC and (size or path.suffix.lower() != ".parquet"):
        return
    if size < LEAST_BYTES or end != MAGIC:
        what = f"Parquet file size is {size} bytes" if size < LEAST_BYTES else "its end is missing"
        raise InputError(f"{path}: not a readable Parquet file, or a damaged one ({what})")


def _check_folder(options: Any, kind: str, what: str = "") -> None:
    """Check the output folder of a result, if one is requested."""
    if options.out is not None:
        called = what or f"an earlier {kind}"
        check_folder(options.out, inputs_of(options), holds(kind), called, force=options.force)
    elif getattr(options, "pictures", False):
        raise InputError("pictures needs --out, a folder for them")


def _check_file(options: Any, path: Path | None, suffix: str = "") -> None:
    """Check an output file, if one is requested."""
    if path is not None:
        check_output(path, inputs_of(options), force=options.force, suffix=suffix)


def check_output(path: Path, inputs: Sequence[Path] = (), *, force: bool, suffix: str = "") -> None:
    """Check that a file may be written, before the command computes its content.

    Raises:
        InputError: the path is an input or lies in one, exists without ``force``, or cannot be written.
    """
    check_no_input(path, inputs)
    check_target(path, suffix)
    if path.exists() and not force:
        raise InputError(f"{path}: exists; give --force to replace it, or name another file")


def check_no_input(path: Path, inputs: Sequence[Path]) -> None:
    """Raise InputError if an output path is an input or lies in one."""
    with system_errors(path):
        real = Path(os.path.realpath(path))
        for given in inputs:
            source = Path(os.path.realpath(given))
            if real == source or (source in real.parents and source.is_dir()):
                where = "is an input" if real == source else f"lies in the input {given}"
                raise InputError(f"{path}: {where}; write somewhere else")


def check_folder(
    path: Path, inputs: Sequence[Path], is_ours: Callable[[Path], bool], what: str, *, force: bool
) -> None:
    """Check that a folder may be written, before the command computes its content.

    Args:
        path: folder to create or replace.
        inputs: files that must not be lost.
        is_ours: tells whether an existing folder holds only an earlier result.
        what: kind of that result, for error messages.
        force: whether an earlier result may be replaced; an empty folder always may.

    Raises:
        InputError: the path is a file, the current folder or one above it, cannot be written, or holds an input, other
            content, or an earlier result without ``force``.
    """
    real = Path(os.path.realpath(path))
    with system_errors(path):
        if real.exists() and not real.is_dir():
            raise InputError(f"{path}: is a file; name a folder to write")
        if real in (here := Path.cwd(), *here.parents):
            raise InputError(f"{path}: is the current folder, or above it; name a folder of its own")
        for entry in inputs:
            if real in Path(os.path.realpath(entry)).parents:
                raise InputError(f"{path}: holds {entry}, which would be lost; name another folder")
        if real.exists() and any(real.iterdir()):
            if not is_ours(real):
                raise InputError(f"{path}: exists and is not {what}; name a new folder")
            if not force:
                raise InputError(f"{path}: is {what}; give --force to replace it, or name a new folder")
    check_place(path)
