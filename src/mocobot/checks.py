"""What each command refuses before it loads numpy, MuJoCo or anything else that takes time: ``check_`` and its name.

Each raises an InputError for an option or an output that cannot be met, or a missing file.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import mocobot_report
from discrepancy.cause_names import JOINTS, TEAM, excluded_from
from estimator.errors import InputError
from estimator.files import check_place, holds
from estimator.strict import read_json
from mocobot import options as opt
from mocobot.campaign.folder import is_campaign
from mocobot.files.targets import (
    calibration_file,
    check_folder,
    check_formats,
    check_no_input,
    check_no_team,
    check_output,
    check_recordings,
    check_there,
    map_file,
)
from mocobot.options import Kind
from mocobot_logs.formats import output_kind
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.scene.models import payload_path, truth_path


def check_fits(name: str, value: float | None, needed: tuple[str, ...], trajectories: Sequence[str]) -> None:
    """Refuse a number that says nothing about any of the motions.

    Raises:
        InputError: it is given, and no trajectory is one of those that need it.
    """
    if value is not None and not set(needed) & set(trajectories):
        given = "this one is" if len(trajectories) == 1 else "these are"
        raise InputError(
            f"{name} is for a {' or '.join(needed)} trajectory; {given} {', '.join(trajectories)}"
        )


VERDICT, PAGE = "verdict.txt", "report.html"


def _given(*named: Path | str | None) -> list[Path]:
    return [Path(name) for name in named if name is not None]


def _check_read(logs: Sequence[Path], *beside: Path | None) -> None:
    """Files that must be there, the logs of a known format."""
    check_there([*logs, *_given(*beside)])
    check_formats(logs)


def _check_jobs(jobs: int) -> None:
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; it must be at least 1")


def check_watch(options: opt.Watch) -> None:
    """Everything that can be refused before a log is read."""
    _check_jobs(options.jobs)
    check_recordings(options.rec)
    stems = [path.stem for path in options.rec]
    for stem in stems:
        if stems.count(stem) > 1:
            raise InputError(f"{stem} is the name of two recordings; give each a name of its own")
    if options.out is not None:
        inputs = [*options.rec, *map_file(options.map)]
        check_folder(options.out, inputs, holds("watch"), "an earlier result of watch", force=options.force)
    _check_read(options.rec)


SCORES, PARTIAL = "paper.json", "partial"


def check_paper(options: opt.Paper) -> None:
    """Everything that can be refused before the experiment is planned."""
    for payload in options.payload:
        payload_path(payload)
    if options.recordings and not options.out:
        raise InputError("--recordings needs --out")
    _check_jobs(options.jobs)
    if options.out and _is_interrupted(options.out):
        check_place(options.out)
    elif options.out:
        check_folder(
            options.out,
            [],
            lambda folder: (folder / SCORES).is_file(),
            "an earlier experiment",
            force=options.force,
        )


def _is_interrupted(folder: Path) -> bool:
    """Whether a folder holds parts of a run, and beside them nothing or its results, which are written at the end.

    Which run's, the command finds out.
    """
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    return names == {PARTIAL} or names >= {PARTIAL, SCORES}


def check_estimate(options: opt.Estimate) -> None:
    """Everything that can be refused before a recording is read."""
    check_recordings(options.rec)
    for name, given in (
        ("--calibration", options.calibration is not None),
        (f"--method {options.method}", options.method != "auto"),
    ):
        if options.self_calibrate and given:
            raise InputError(f"--self-calibrate and {name} are both given; choose one")
    if options.out is not None:
        inputs = [*options.rec, *map_file(options.map), *calibration_file(options.calibration)]
        check_output(options.out, inputs, force=options.force)
    _check_read(options.rec)


def check_calibrate(options: opt.Calibrate) -> None:
    """Everything that can be refused before a recording is read."""
    if not options.rec:
        raise InputError("no recording with a payload is given; name them first, those of --free after it")
    files = [*options.rec, *options.free]
    check_recordings(files)
    if options.out is not None:
        inputs = [*files, *_given(options.prior), *map_file(options.map)]
        check_folder(options.out, inputs, holds("calibration"), "an earlier calibration", force=options.force)
    _check_read(files)


TRUTH = "the truth beside a simulated recording"
LONGEST_S = 1e6


def check_diagnose(options: opt.Diagnose) -> None:
    """Everything that can be refused before a recording is read."""
    if not options.rec and options.exclude:
        raise InputError("no recording given; name them before --exclude")
    _check_jobs(options.jobs)
    check_odds(options.odds)
    check_recordings(options.rec)
    if options.model is not None:
        _check_joints(options, options.model)
        return
    if options.reference:
        raise InputError("--reference goes with --model: a healthy log of the same robot")
    check_seconds(options.seconds, "--seconds")
    if options.out is not None:
        inputs = [*options.rec, *_given(options.tolerances), *map_file(options.map)]
        inputs += calibration_file(options.calibration)
        check_folder(options.out, inputs, holds("diagnosis"), "an earlier diagnosis", force=options.force)
    _check_excluded(options.exclude, TEAM)
    check_there(options.rec)
    check_formats(options.rec)
    for path in filter(Path.exists, map(truth_path, options.rec)):
        read_json(path, TRUTH)  # what it says, nobody asks before the verdict


MOST_ODDS = 1000.0


def check_odds(odds: float) -> None:
    """Odds of a cause beforehand."""
    if not 0.0 < odds <= MOST_ODDS:
        raise InputError(f"odds is {odds:g}; it must be greater than 0 and at most {MOST_ODDS:g}")


def check_seconds(seconds: float | None, name: str = "seconds") -> None:
    """When a search ends."""
    if seconds is not None and not 0.0 < seconds <= LONGEST_S:
        raise InputError(f"{name} is {seconds:g}; it must be above 0 and at most {LONGEST_S:g} s")


def _check_joints(options: opt.Diagnose, model: Path) -> None:
    """What can be refused of logs of one robot's joints, but for maps that nobody named."""
    check_no_team(options, ("calibration", "scheduler"))
    plain = opt.Diagnose(options.rec)
    for name in ("laws", "odds", "whole", "jobs"):
        if getattr(options, name) != getattr(plain, name):
            raise InputError(f"--{name} is of a team's robots; with --model there is none")
    check_seconds(options.seconds, "--seconds")
    logs = [*options.rec, *options.reference]
    check_recordings(logs)
    if options.out is not None:
        inputs = [*logs, *_given(model, options.tolerances, options.map)]
        check_folder(options.out, inputs, holds("diagnosis"), "an earlier diagnosis", force=options.force)
    _check_excluded(options.exclude, JOINTS)
    _check_read(logs, model)


def _check_excluded(excluded: Sequence[str], causes: Sequence[str]) -> None:
    excluded_from(causes, excluded)
    if set(causes) <= set(excluded):
        raise InputError("every cause is excluded; nothing is left to look for")


SLOWEST_HZ, FASTEST_HZ = 20.0, 2000.0
"""Bounds of the recording's rate: the estimator's filter passes 5 Hz."""
LONGEST_GAP_S = 10.0


def check_convert(options: opt.Convert) -> None:
    """Everything that can be refused before the log is read."""
    check_target(options, targets(options.out, 1)[0] if options.split_at_gaps else options.out)
    if options.json is not None:
        check_output(options.json, [*_inputs(options), options.out], force=options.force)
    for option, value, low, high in (
        ("--rate", options.rate, SLOWEST_HZ, FASTEST_HZ),
        ("--max-gap", options.max_gap, 0.0, LONGEST_GAP_S),
    ):
        if not low <= value <= high:
            raise InputError(f"{option} is {value:g}; it must be from {low:g} to {high:g}")
    _check_read([options.log])


def targets(out: Path, count: int) -> list[Path]:
    """Numbered names for the parts of a log."""
    width = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{width}}{out.suffix}") for k in range(1, count + 1)]


def check_target(options: opt.Convert, out: Path) -> None:
    """One recording, under the name that it will have.

    Raises:
        InputError: it may not be written, or cannot.
    """
    if output_kind(out) != "folder":
        check_output(out, _inputs(options), force=options.force)
        return
    check_no_input(out, _inputs(options))
    check_folder(out, _inputs(options), holds("bag"), "a bag of an earlier conversion", force=options.force)


def _inputs(options: opt.Convert) -> list[Path]:
    return [options.log, *_given(options.design), *map_file(options.map)]


def check_map(options: opt.Map) -> None:
    """Everything that can be refused before the log is read."""
    if options.out is not None:
        check_output(options.out, [options.log, *_given(options.model)], force=options.force)
    _check_read([options.log], options.model)


def check_replay(options: opt.Replay) -> None:
    """Everything that can be refused before a recording is read."""
    if options.save is not None and options.web:
        raise InputError("--save and --web are both given; choose a file or a browser")
    check_recordings(options.rec)
    if options.model is not None:
        check_no_team(options, ("estimate", "calibration", "diagnosis", "payload", "truth"))
    elif options.map is not None:
        raise InputError("--map goes with --model; logs of a team are converted to recordings first")
    if options.save is not None:
        inputs = [*options.rec, *_given(options.estimate, options.model, options.map)]
        inputs += calibration_file(options.calibration)
        check_output(options.save, inputs, force=options.force, suffix=".rrd")
    _check_read(options.rec, options.model)


def check_inspect(options: opt.Inspect) -> None:
    """Everything that can be refused before the log is read."""
    inputs = [options.rec, *calibration_file(options.calibration)]
    if options.model is not None:
        check_no_team(options, ("design", "calibration"))
        inputs += _given(options.model, options.map)
    if options.json is not None:
        check_output(options.json, inputs, force=options.force)
    _check_read([options.rec], options.model)


def check_report(options: opt.Report) -> None:
    """A folder that is none, and a page that may not be written, or cannot."""
    if options.dir.is_file() and options.dir.suffix != ".json":
        return  # the command finds out what kind of file it is
    mocobot_report.check_folder(options.dir)
    check_output(options.out or options.dir / mocobot_report.NAME, force=options.force, suffix=mocobot_report.SUFFIX)


def check_compare(options: opt.Compare) -> None:
    """Everything that can be refused before a result is read."""
    if options.out is not None:
        inputs = [options.a, options.b]
        check_folder(options.out, inputs, holds("comparison"), "an earlier comparison", force=options.force)
    check_there([options.a, options.b])


CAMPAIGN_KINDS = ("random", "periodic", "static")


def check_campaign(options: opt.Campaign) -> None:
    """Everything that can be refused before a team is built, but for the names of causes and of sensors."""
    kinds = campaign_kinds(options)
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


def campaign_kinds(options: opt.Campaign) -> tuple[str, ...]:
    """Kind of every trial.

    Raises:
        InputError: one is of no known kind.
    """
    return tuple(_kinds(options.trials, CAMPAIGN_KINDS))


def inputs_of(options: opt.Campaign) -> list[Path]:
    """Files that are read."""
    given = Path(options.payload)
    named = [given if given.suffix == ".xml" else None, options.units, options.tolerances]
    return [path for path in named if path is not None] + calibration_file(options.calibration)


KINDS = get_args(Kind)


def check_simulate(options: opt.Simulate) -> None:
    """Everything that can be refused before a team is built, the effects' numbers among it."""
    kinds = simulate_kinds(options)
    given = Path(options.payload or "")
    inputs = [*([given] if given.is_file() else []), *_given(options.units)]
    if options.out is not None:
        check_output(options.out, inputs, force=options.force, suffix=".parquet")
        check_output(truth_path(options.out), inputs, force=options.force)
    elif options.out_dir is not None:
        check_folder(
            options.out_dir, inputs, holds("simulation"), "an earlier simulation", force=options.force
        )
    check_fits("--vias", options.vias, ("random", "free"), kinds)
    check_fits("--duration", options.duration, ("periodic",), kinds)
    check_fits("--robots", options.robots, ("free",), kinds)
    for one, other, why in (
        ("payload", "robots", "a payload says how many robots there are"),
        ("payload", "model", "the model has its own payload, so leave one out"),
        ("units", "model", "the model has robots of its own, so leave one out"),
    ):
        if getattr(options, one) is not None and getattr(options, other) is not None:
            raise InputError(f"--{one} and --{other} are both given; {why}")
    if options.payload is not None and given.suffix != ".xml":
        payload_path(options.payload)
    for text in options.effect:
        check_effect_name(text.partition(":")[0])
    if options.effect:
        from mocobot_sim.effects.catalogue import parse_effect  # numpy, and a file for each effect

        for text in options.effect:
            parse_effect(text)


def simulate_kinds(options: opt.Simulate) -> list[str]:
    """Kind of every trial.

    Raises:
        InputError: neither one trial is named nor several, or one of no known kind.
    """
    if options.trials is None:
        if options.out is None:
            raise InputError(
                "--out REC.parquet, or --trials with --out-dir DIR, must be given; see mocobot simulate --help"
            )
        if options.out_dir is not None:
            raise InputError(
                "--out-dir is for several trials; name their kinds with --trials, or leave it out"
            )
        return [options.trajectory]
    if options.out is not None or options.out_dir is None:
        raise InputError("--trials needs --out-dir DIR, a folder for its recordings, in place of --out")
    return _kinds(options.trials, KINDS)


def _kinds(trials: str, known: Sequence[str]) -> list[str]:
    kinds = trials.split(",")
    if not set(kinds) <= set(known):
        raise InputError(
            f"--trials is {trials!r}; it must be a list such as random,random,periodic,static of {', '.join(known)}"
        )
    return kinds


def check_effects(options: opt.Effects) -> None:
    """Names of effects."""
    for name in options.name:
        check_effect_name(name)
