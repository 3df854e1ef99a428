"""``mocobot paper``: run the experiment, print the tables, write the results."""

import time
from dataclasses import asdict
from pathlib import Path

from estimator.calibrate.json import calibration_to_dict
from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.recording.parquet import write_recording
from mocobot.checks import SCORES
from mocobot.cluster import workers_of
from mocobot.files.provenance import NAME, folder_provenance, provenance
from mocobot.files.resume import run_key
from mocobot.options import Paper
from mocobot.progress import share_bar
from mocobot_sim.paper.experiment import PaperPlan, PaperResult, run_paper
from mocobot_sim.paper.store import Store
from mocobot_sim.paper.tables import format_summary, format_tables
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import draw_units
from mocobot_sim.trial.truth import GroundTruth, truth_path, write_truth


def run(options: Paper) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met.
        TrialError: the physics of a trial cannot be trusted.
    """
    plan = PaperPlan(
        options.payload, options.preset, options.trials, options.seed, staged_only=options.staged_only
    )
    start, made_with = time.perf_counter(), provenance("paper", asdict(options))
    store = Store(options.out, run_key(asdict(plan)), force=options.force) if options.out else None
    with workers_of(options.scheduler), share_bar("paper", "steps") as tell:
        result = run_paper(plan, options.jobs, tell, store, remote=options.scheduler is not None)
    tables = f"{format_tables(result.scores)}\n\n{format_summary(result.scores)}"
    print(tables)
    print(f"\n{_summary(result)} Wall time {time.perf_counter() - start:.0f} s.")
    if options.out:
        written = _write(options.out, plan, result, tables)
        if options.recordings:
            written += _write_recordings(options.out / "recordings", plan, result)
        write_json(options.out / NAME, folder_provenance(made_with, options.out, written))
        if store is not None:
            store.drop()
        print(
            f"Written to {options.out}: paper.json, tables.txt, provenance.json, estimates, fits and plots."
        )


def _summary(result: PaperResult) -> str:
    trials = result.trials
    damping = min((t.damping_ratio for t in trials if t.damping_ratio is not None), default=0.0)
    return (
        f"{len(trials)} trials: payload rotation at most {max(t.rotation_deg for t in trials):.1f} deg, "
        f"SEA torque {max(t.torque_Nm for t in trials):.1f} N m, "
        f"rod error {1e3 * max(t.rod_error_m for t in trials):.4f} mm, "
        f"weld error {1e3 * max(t.weld_error_m for t in trials):.4f} mm "
        f"and {max(t.weld_error_deg for t in trials):.5f} deg; control "
        f"{'stable' if damping > 0 else 'UNSTABLE'} (damping ratio at least {damping:.2g})."
    )


def _write(folder: Path, plan: PaperPlan, result: PaperResult, tables: str) -> list[Path]:
    """Write scores, tables, estimates, fits and plots, and say where."""
    scores, text, trials = (folder / name for name in (SCORES, "tables.txt", "trials.json"))
    write_json(scores, result.scores)
    write_text(text, tables + "\n")
    write_json(trials, {"trials": [asdict(trial) for trial in result.trials]})
    written = [scores, text, trials]
    estimates = folder / "estimates"
    for preset in plan.presets:
        for payload in plan.payloads:
            written.append(estimates / f"{payload}_{preset}.json")
            write_json(written[-1], result.estimates[preset][payload].to_dict())
    for column, fits in result.fits.items():
        for payload, found in fits.items():
            written.append(folder / "fits" / f"{payload}_{column.replace(', ', '_').replace(' ', '_')}.json")
            write_json(written[-1], calibration_to_dict(found))
    if not draws_plots():
        return written
    from mocobot_sim.paper.plots import save_plots  # matplotlib, which printing needs not

    return written + save_plots(result.scores, folder)


def _write_recordings(folder: Path, plan: PaperPlan, result: PaperResult) -> list[Path]:
    """Write recordings with the truth beside each, and say where."""
    written = []
    for payload in plan.payloads:
        for preset in plan.presets:
            truth = GroundTruth.of(build_team(payload, draw_units(payload, sensor_preset(preset), plan.seed)))
            for recording in result.recordings[preset][payload]:
                path = folder / f"{recording.name}.parquet"
                write_recording(recording, path)
                write_truth(truth, path)
                written += [path, truth_path(path)]
    return written
