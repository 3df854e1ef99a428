"""``mocobot campaign``: hide effects in simulated teams, diagnose blind, count, and write it."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from discrepancy.team.causes import CAUSES, read_tolerances
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import file_facts, write_json, write_text
from mocobot.campaign.folder import REPORT, SUMMARY, TABLE
from mocobot.campaign.plan import CampaignPlan
from mocobot.campaign.run import run_campaign
from mocobot.campaign.store import CampaignStore
from mocobot.campaign.summary import summarise
from mocobot.campaign.text import csv_table, format_campaign
from mocobot.checks import campaign_kinds, inputs_of
from mocobot.cluster import workers_of
from mocobot.files.calibrations import read_calibration
from mocobot.files.provenance import NAME, folder_provenance, provenance
from mocobot.files.resume import run_key
from mocobot.options import Campaign
from mocobot.progress import bar
from mocobot_sim.effects import EFFECTS
from mocobot_sim.scene.as_built import read_units
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import sensor_preset

NO_MATTER = ("out", "force", "jobs", "scheduler", "sets")
"""Options that a set's result does not depend on."""
FILES = ("payload", "units", "calibration", "tolerances")
"""Options that may name a file, of which the content counts."""


def run(options: Campaign) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met, a folder of another campaign, or an output that cannot be written.
    """
    start, plan = time.perf_counter(), plan_of(options)
    made_with = provenance("campaign", asdict(options), inputs_of(options))
    store = CampaignStore(options.out, config_of(options), force=options.force)
    sets = [*plan.clean_sets(), *plan.hidden_sets()]
    with workers_of(options.scheduler), bar(len(sets), "campaign", "set") as done:
        results = run_campaign(plan, store, options.jobs, done, remote=options.scheduler is not None)
    summary = summarise(results, plan.exclude)
    print(format_campaign(summary))
    print(f"\nWall time {time.perf_counter() - start:.0f} s.")
    written = _write(options.out, summary)
    write_json(options.out / NAME, folder_provenance(made_with, options.out, written))
    print(f"Written to {options.out}: {SUMMARY}, {TABLE}, {REPORT}, {NAME}, sets and plots.")


def plan_of(options: Campaign) -> CampaignPlan:
    """The campaign that the options ask for.

    Raises:
        InputError: a cause that does not exist, sensors that are not calibrated, or a file that cannot be used.
    """
    for name, given in (("causes", options.causes), ("exclude", options.exclude)):
        for cause in given:
            if cause not in CAUSES or cause not in EFFECTS:
                raise InputError(
                    f"--{name}: cause {cause!r} does not exist; the causes are {', '.join(CAUSES)}"
                )
    if both := set(options.causes) & set(options.exclude):
        raise InputError(f"{both.pop()} is both to be hidden and excluded; choose one")
    if not sensor_preset(options.preset).calibrated:
        raise InputError(
            f"--preset {options.preset} draws robots of its own; use nominal, and --background uncalibrated"
        )
    units = () if options.units is None else read_units(options.units)
    robots = build_team(options.payload).robots
    if units and len(units) != robots:
        raise InputError(
            f"{options.units}: has {len(units)} robots; the payload {options.payload} is carried by {robots}"
        )
    return CampaignPlan(
        payload=options.payload, trials=campaign_kinds(options), vias=options.vias, duration_s=options.duration,
        preset=options.preset, backgrounds=("units",) if units else options.background, units=units,
        calibration=None if options.calibration is None else read_calibration(options.calibration),
        tolerances=read_tolerances(options.tolerances), exclude=options.exclude, closed_loop=options.closed_loop,
        causes=options.causes, sizes=options.sizes, teams=options.teams, sets=options.sets, seed=options.seed,
    )  # fmt: skip


def config_of(options: Campaign) -> dict[str, str]:
    """What sets depend on, as text by name, the code last.

    Raises:
        InputError: a file cannot be read.
    """
    values = {name: value for name, value in asdict(options).items() if name not in NO_MATTER}
    files = inputs_of(options)
    for name in FILES:
        given = values[name]
        of = [file for file in files if given is not None and Path(given) in (file, file.parent)]
        if of:
            values[name] = f"{of[0].name} (sha256 {file_facts(of[0])['sha256'][:12]})"
    return {name: _words(value) for name, value in values.items()} | {"code": run_key({})}


def _words(value: Any) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " ".join(map(_words, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _write(folder: Path, summary: Mapping[str, Any]) -> list[Path]:
    """Write summary, table, report and plots, and say where."""
    data, table, report = (folder / name for name in (SUMMARY, TABLE, REPORT))
    write_json(data, summary)
    write_text(table, csv_table(summary))
    write_text(report, f"{format_campaign(summary)}\n")
    if not draws_plots():
        return [data, table, report]
    from mocobot.campaign.plots import save_plots  # matplotlib, which printing needs not

    return [data, table, report, *save_plots(summary, folder)]
