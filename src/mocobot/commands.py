"""The commands, one function each: call ``mocobot``, write the results and print the report.

A command prints after it has written all files, because the reader of its output may close the pipe.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
import textwrap
import time
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import mocobot
from estimator.errors import InputError
from estimator.files import whole_folder, write_json, write_text
from estimator.strict import read_json
from mocobot import options as opt
from mocobot.checks import TRUTH, check_target_of, inputs_of, targets
from mocobot.cli import NotGood
from mocobot.next_step import after_calibration, command_line, next_step
from mocobot.progress import bar, share_bar, stages
from mocobot.results import Folder, file_facts, provenance
from mocobot_sim.scene.models import truth_path

WIDTH, WIDEST, INDENT = 110, 100, "    "


def inspect(options: opt.Inspect) -> None:
    """Inspect a log; only ``strict`` turns findings into an exit code other than 0."""
    with bar(None, "reading", "") as advance, bar(None, "checking", "mistake") as tried:
        found = mocobot.inspect(options.rec, options.model, options, advance=advance, tried=tried)
    if options.json is not None:
        found.write(options.json)
    print(found)
    if options.strict and not found.is_ready:
        raise NotGood(found.ready_for)


def map(options: opt.Map) -> None:
    """Draft a map of a log; the draft marks doubtful lines, and standard error states their number."""
    draft = mocobot.map(options.log, options.model, options)
    if options.out is None:
        print(draft, end="")
    else:
        draft.write(options.out)
    print(f"mocobot: {draft.summary}", file=sys.stderr)


def convert(options: opt.Convert) -> None:
    """Resample a log onto one time grid, write it and report the conversion."""
    with bar(None, "reading", "") as advance:
        if options.split_at_gaps:
            parts = mocobot.convert_parts(options.log, options, advance=advance)
        else:
            parts = [mocobot.convert(options.log, options, advance=advance)]
    names = targets(options.out, len(parts)) if options.split_at_gaps else [options.out]
    for target in names if options.split_at_gaps else ():
        check_target_of(options, target)
    written = list(zip(parts, names, strict=True))
    for part, target in written:
        with bar(len(part.recording.time), "writing", "sample") as advance:
            part.write(target, advance, replace_bag=options.force)
    if options.json is not None:
        from mocobot.api.conversion import conversions_dict

        write_json(options.json, conversions_dict(written))
    for part, target in written:  # parts of one log share what was left out, which is said once
        print((replace(part, left_out=()) if options.split_at_gaps else part).report(target))
    if options.split_at_gaps:
        if said := parts[0].omissions():
            print(said)
        for old in _earlier(options.out, names):
            print(f"{old} is of an earlier conversion, and was left as it is")


def _earlier(out: Path, written: Sequence[Path]) -> list[Path]:
    """Find numbered recordings from earlier conversions, which this conversion did not write."""
    numbered = re.compile(re.escape(out.stem) + r"-[0-9]+" + re.escape(out.suffix))
    names = {target.name for target in written}
    return sorted(
        path for path in out.parent.iterdir() if numbered.fullmatch(path.name) and path.name not in names
    )


def estimate(options: opt.Estimate) -> None:
    """Estimate the payload of recordings; write and print the estimate."""
    notes: list[str] = []
    with stages() as (say, _):
        found = mocobot.estimate(options.rec, options, say=say, note=notes.append)
    two = isinstance(found, mocobot.TwoBodyEstimate)
    text = found.beside_truth(Path(options.rec[0])) if two else str(found)
    if options.out or options.json:
        values = found.to_dict() | {"provenance": provenance("estimate", options, inputs_of(options))}
        if options.pictures and options.out:
            with whole_folder(options.out, "estimate") as folder:
                write_json(folder / "estimate.json", values)
                write_text(folder / "report.txt", f"{text}\n")
                notes += (
                    ["A payload of two bodies is not drawn."]
                    if two
                    else _team_picture(options, found, folder / "team.png")
                )
        for path in _paths(options.json, None if options.pictures else options.out):
            write_json(path, values)
    print("\n".join([*notes, text]))
    if options.strict and found.flags:
        raise NotGood(f"the estimate is flagged: {found.flags[0]}")
    if options.strict and not two and found.mass is None and found.grasps is None:
        raise NotGood("the recordings determine neither mass nor grasps")


def _team_picture(options: opt.Estimate, found: Any, path: Path) -> list[str]:
    """Draw the estimated team in the middle of the first recording.

    Returns:
        A sentence that explains why there is no picture; empty if there is one.
    """
    from matplotlib.image import imsave

    from mocobot.api.recordings import recordings_of
    from mocobot.pictures import estimate_view

    picture = estimate_view(next(recordings_of(options.rec, options.map, episode=options.episode)), found)
    if isinstance(picture, str):
        return [picture]
    imsave(path, picture)
    return []


def calibrate(options: opt.Calibrate) -> None:
    """Estimate how the robots differ from their model; write and print the calibration."""
    notes: list[str] = []
    with stages() as (say, _):
        found = mocobot.calibrate(
            options.rec, options.model, options.free, options, say=say, note=notes.append
        )
        made_with = {}
        if options.out or options.json:
            made_with = provenance("calibrate", options, _inputs_with_model(options))
        missing = _write(found, options, made_with, say)
    print("\n".join([*notes, str(found)]))
    if options.out:
        print("\n".join([f"\nWritten to {options.out}.", *(f"But {note}." for note in missing)]))
        if options.model is not None:
            print(after_calibration(options))
    if options.strict and found.findings:
        raise NotGood(f"the calibration is not to be trusted: {found.findings[0].rstrip('.')}")


def diagnose(options: opt.Diagnose) -> None:
    """Find out what the simulation gets wrong; write and print the diagnosis."""
    notes: list[str] = []
    made_with = {}
    if options.out or options.json:
        made_with = provenance("diagnose", options, _inputs_with_model(options))
    with stages() as (say, simulated):
        found = mocobot.diagnose(
            options.rec,
            options.model,
            options.reference,
            options,
            say=say,
            simulated=simulated,
            note=notes.append,
        )
        truth = _truth(options.rec) if options.model is None else None
        if truth is not None:
            found = found.against_truth(truth)
        if made_with and found.used_truth:
            made_with["files"] += [file_facts(truth_path(path)) for path in options.rec]
        _write(found, options, made_with, say)
    print("\n".join([*notes, found.verbose_text() if options.verbose else str(found)]))
    if options.out:
        print(f"\nWritten to {options.out}.")
    print(next_step(options, found.to_dict()), end="")
    if options.strict and found.verdict not in ("consistent", "explained"):
        raise NotGood(f"the verdict is {found.verdict.replace('_', ' ')}")


def _inputs_with_model(options: opt.Diagnose | opt.Calibrate) -> list[Path]:
    """List the files that a command reads that may take the model of a single robot."""
    if options.model is None:
        return inputs_of(options)
    from mocobot.api.joints import map_path, read_model

    robot, logs = (
        read_model(options.model, lock=options.lock, base=options.base),
        [*options.rec, *getattr(options, "reference", ())],
    )
    maps = {map_path(robot, log, options.map) for log in logs}
    return [options.model, *sorted(maps), *logs, *_paths(getattr(options, "tolerances", None))]


def _truth(paths: Sequence[Path]) -> dict[str, Any] | None:
    """Read the truth files beside the recordings; None unless all state the same payload.

    The command calls this after the verdict, so that the truth cannot influence it.
    """
    keys = ("grasps", "mass_kg", "p_1c_m", "principal_inertia_kgm2")
    found = []
    for path in paths:
        try:
            values = read_json(truth_path(path), TRUTH)
            found.append({key: values[key] for key in keys} | {"as_built": values.get("as_built")})
        except (InputError, KeyError):
            return None
    return found[0] if all(values == found[0] for values in found) else None


def watch(options: opt.Watch) -> None:
    """Turn logs into a first verdict and a page that shows it; with ``follow``, tell of each new log until Ctrl-C."""
    if options.model is None:
        return _watch(options)
    from mocobot.api.watch_joints import logs_in, new_logs

    if not options.follow:
        return _watch(replace(options, rec=tuple(logs_in(options.rec, options.reference))))
    print(f"Waiting for logs: {', '.join(str(path) for path in options.rec)}; Ctrl-C ends it.", flush=True)
    with suppress(KeyboardInterrupt):
        for log in new_logs(options.rec, options.reference):
            try:
                _watch(replace(options, rec=(log,), strict=False))
            except InputError as error:
                print(f"{log}: left out, {error}.", flush=True)


def _watch(options: opt.Watch) -> None:
    """Look once; write and print what was found."""
    out = options.out
    made_with = provenance("watch", options, inputs_of(options))
    if out is None and options.open:
        out = Path(tempfile.mkdtemp(prefix="mocobot-watch-")) / "watch"
    page = None
    with stages() as (say, simulated):
        seen = mocobot.watch(
            options.rec,
            options,
            model=options.model,
            reference=options.reference,
            say=say,
            simulated=simulated,
        )
        if out is not None:
            say("write")
            with whole_folder(out, seen.result) as folder:
                seen.write_into(folder, pictures=options.pictures, provenance=made_with)
            if seen.estimate or seen.diagnosis:
                page = mocobot.report(out, say=say)
                seen.lines.append(f"The page with all of it: {page}.")
    lines = (textwrap.wrap(line, WIDTH, subsequent_indent="  ") for line in seen.lines)
    print("\n".join(part for wrapped in lines for part in wrapped), flush=True)
    if seen.of_joints and seen.diagnosis is not None:
        print(next_step(options, seen.diagnosis.to_dict()), end="", flush=True)
    if options.open and page is not None:
        webbrowser.open(page.resolve().as_uri())
    if options.strict and not seen.good:
        raise NotGood(seen.lines[-1].rstrip("."))


def compare(options: opt.Compare) -> None:
    """Compare two results and report what differs by more than its standard errors."""
    found = mocobot.compare(options.a, options.b)
    inputs = [path for path in (options.a, options.b) if path.is_file()]
    _write(found, options, provenance("compare", options, inputs) if options.out or options.json else {})
    print(found)
    if options.out:
        print(f"\nWritten to {options.out}.")
    if options.strict and found.changed:
        raise NotGood(f"they differ: {found.what_changed or found.changes[0].rstrip('.')}")


def simulate(options: opt.Simulate) -> None:
    """Simulate trials of one team; write their recordings with the truth beside each."""
    from mocobot.trajectories import RATE_HZ

    kinds, out, many = options.kinds, options.out, options.trials is not None
    assert out is not None
    kind, *others = kinds
    length, unit = (f"{len(kinds)} trials", "trial") if others else (f"{kind} trial", "s")
    with share_bar(length, unit) as tell:

        def progress(trial: int, done: int, samples: int) -> None:
            if not others:
                tell(done / RATE_HZ, samples / RATE_HZ, "")
            else:
                tell(trial - 1 + done / samples, len(kinds), kinds[trial - 1])

        done = mocobot.simulate_trials(options.payload, kinds, options, progress=progress)
    width = len(str(len(kinds)))
    names = [f"trial{k:0{width}}_{kind}.parquet" for k, kind in enumerate(kinds, start=1)]
    if many:
        with whole_folder(out, "simulation") as folder:
            for recording, name in zip(done, names, strict=True):
                recording.write(folder / name)
    else:
        done[0].write(out)
    paths = [out / name for name in names] if many else [out]
    for recording, path in zip(done, paths, strict=True):
        print(
            f"{path}: {recording.time[-1]:.1f} s of {recording.metadata.trial} motion, {options.preset} sensors"
        )
        if warning := recording.log.stability and recording.log.stability.warning:
            print(warning)


def effects(options: opt.Effects) -> None:
    """List the effects that a simulation can hide, from the docstrings and fields of their classes."""
    from mocobot_sim.effects.catalogue import EXAMPLE, allowed, paragraphs

    width = min(WIDEST, shutil.get_terminal_size((WIDEST, 24)).columns)
    for name in options.name or mocobot.EFFECTS:
        kind = mocobot.EFFECTS[name]
        print(name)
        for text in paragraphs(kind)[: None if options.name else 1]:
            print(textwrap.fill(text, width, initial_indent=INDENT, subsequent_indent=INDENT))
        for each in allowed(kind):
            default = each.default
            given = (default or "none") if isinstance(default, str) else f"{default or 0.0:g}"
            rule = each.range if default is None else f"{each.range}; {given} if not given"
            print(f"{INDENT}{each.short:15}{each.unit:12}{rule}")
        print()
    print(textwrap.fill(f"Hide one with mocobot simulate --effect {EXAMPLE} ...", width))


def example(options: opt.Example) -> None:
    """Write an example and print what to type next."""
    from mocobot_sim.serial.example import ANSWER, LAST_WEEK, MODEL, TODAY, write_example

    with whole_folder(options.out, "example") as folder:
        write_example(folder)
    today, last_week, model = (options.out / name for name in (TODAY, LAST_WEEK, MODEL))
    arm = [today, "--model", model]
    print(f"{today}: 30 s of a six-axis arm with one fault. {last_week}: the arm before. {model}: its model.")
    for purpose, command, made in (
        ("Which column is which joint?", ["map", *arm], "log.toml"),
        ("What does the model get wrong?", ["diagnose", *arm], "verdict"),
        ("What has changed since last week?", ["diagnose", *arm, "--reference", last_week], "changed"),
        ("What is the model of the arm as it is?", ["calibrate", *arm], "calibrated"),
    ):
        print(f"\n{purpose}\n    {command_line([*command, '--out', options.out / made])}")
    print(f"\nThe answer is in {options.out / ANSWER}.")


def campaign(options: opt.Campaign) -> None:
    """Hide effects in simulated teams, diagnose them blind, and write the hit and error rates."""
    from mocobot.campaign import run

    start = time.perf_counter()
    with bar(None, "campaign", "set") as done:
        summary = run.campaign(options.out, options, force=options.force, done=done)
    print(summary)
    print(f"\nWall time {time.perf_counter() - start:.0f} s.")
    if options.json is not None:
        write_json(options.json, summary.values)
    print(f"Written to {options.out}: {summary.write(options.out, pictures=options.pictures)}.")


def paper(options: opt.Paper) -> None:
    """Run the paper's experiment; print its tables and write its results."""
    from mocobot.api.paper import run_experiment

    start = time.perf_counter()
    with share_bar("paper", "steps") as tell:
        done = run_experiment(options, tell)
    print(done)
    print(f"\n{done.physics} Wall time {time.perf_counter() - start:.0f} s.")
    if options.out:
        done.write(options.out, recordings=options.recordings)
        print(
            f"Written to {options.out}: paper.json, tables.txt, provenance.json, estimates, fits and plots."
        )


def report(options: opt.Report) -> None:
    """Make one HTML page from a result folder."""
    if options.dir.is_file() and options.dir.suffix != ".json":
        from mocobot.api.recordings import check_no_log

        check_no_log(options.dir)
        raise InputError(
            f"{options.dir}: is a file; name a folder of results, such as mocobot estimate --out results/est.json makes"
        )
    with stages() as (say, _):
        page = mocobot.report(options.dir, options.out, say=say)
    print(f"{page}: {page.stat().st_size / 1e6:.1f} MB; open it in a browser, or hand it on.")


def replay(options: opt.Replay) -> None:
    """Show recordings as moving scenes and time series: in the Rerun viewer, a browser or a file."""

    def note(text: str) -> None:
        print(text, flush=True)

    with bar(len(options.rec), "logging", "recording") as advance:
        mocobot.replay(options.rec, options.out, options.model, options, note=note, advance=advance)
    if options.out is not None:
        size = options.out.stat().st_size / 1e6
        print(f"{options.out}: {size:.1f} MB; open it with: rerun {options.out}")


def _paths(*given: Any) -> list[Path]:
    return [path for path in given if path is not None]


def _write(
    found: Folder,
    options: opt.Calibrate | opt.Diagnose | opt.Compare,
    made_with: dict[str, Any],
    say: Callable[[str], object] = lambda _: None,
) -> list[str]:
    """Write the requested folder and JSON; return one sentence per file that could not be made."""
    missing: Any = None
    if options.out is not None:
        say("write")
        pictures = getattr(options, "pictures", True)
        with whole_folder(options.out, found.result) as folder:
            missing = found.write_into(folder, pictures=pictures, provenance=made_with)
    if options.json is not None:
        write_json(options.json, found.to_dict() | {"provenance": made_with})
    return missing or []
