"""The paper's experiment: run it, and write its tables, estimates and plots."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from estimator.calibrate.json import calibration_to_dict
from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.recording.parquet import write_recording
from mocobot.checks import SCORES
from mocobot.cluster import workers_of
from mocobot.options import Paper
from mocobot.results import NAME, folder_provenance, provenance, run_key
from mocobot_sim.effects import apply_effects
from mocobot_sim.paper.experiment import (
    SCATTERED,
    PaperPlan,
    PaperResult,
    preset_named,
    run_paper,
    scattering,
)
from mocobot_sim.paper.measured import agreement, format_agreement
from mocobot_sim.paper.store import Store
from mocobot_sim.paper.tables import format_summary, format_tables
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.simulate import draw_units
from mocobot_sim.trial.truth import GroundTruth, truth_path, write_truth


@dataclass(frozen=True)
class Experiment:
    """Outcome of the paper's experiment.

    Attributes:
        plan, result: plan and result of the experiment.
        made_with: provenance.
        store: partial results for resuming an interrupted run; deleted after all results are written.
    """

    plan: PaperPlan
    result: PaperResult
    made_with: dict[str, Any]
    store: Store | None

    def __str__(self) -> str:
        """Return the tables, their summary, and how well they agree with the published ones."""
        scores, trials = self.result.scores, self.plan.trials
        columns = {
            preset: agreement(scores[preset], trials, not preset_named(preset).calibrated)
            for preset in self.plan.presets
        }
        return f"{format_tables(scores)}\n\n{format_summary(scores)}\n\n{format_agreement(columns)}"

    @property
    def physics(self) -> str:
        """Largest motions of the trials and constraint errors of MuJoCo, in one sentence."""
        trials = self.result.trials
        damping = min((t.damping_ratio for t in trials if t.damping_ratio is not None), default=0.0)
        return (
            f"{len(trials)} trials: payload rotation at most {max(t.rotation_deg for t in trials):.1f} deg, "
            f"SEA torque {max(t.torque_Nm for t in trials):.1f} N m, "
            f"rod error {1e3 * max(t.rod_error_m for t in trials):.4f} mm, "
            f"weld error {1e3 * max(t.weld_error_m for t in trials):.4f} mm "
            f"and {max(t.weld_error_deg for t in trials):.5f} deg; control "
            f"{'stable' if damping > 0 else 'UNSTABLE'} (damping ratio at least {damping:.2g})."
        )

    def write(self, folder: Path, *, recordings: bool = False) -> None:
        """Write scores, tables, estimates, fits and plots, and optionally the recordings."""
        plan, result, written = self.plan, self.result, []

        def put(name: str, values: Any) -> None:
            written.append(folder / name)
            write_json(written[-1], values)

        put(SCORES, result.scores)
        put("trials.json", {"trials": [asdict(trial) for trial in result.trials]})
        for preset in plan.presets:
            for payload in plan.payloads:
                put(f"estimates/{payload}_{preset}.json", result.estimates[preset][payload].to_dict())
        for column, fits in result.fits.items():
            for payload, found in fits.items():
                name = f"{payload}_{column.replace(', ', '_').replace(' ', '_')}"
                put(f"fits/{name}.json", calibration_to_dict(found))
        written.append(folder / "tables.txt")
        write_text(written[-1], f"{self}\n")
        if draws_plots():
            from mocobot_sim.paper.plots import save_plots  # imports matplotlib

            written += save_plots(result.scores, folder)
        if recordings:
            written += self._write_recordings(folder / "recordings")
        write_json(folder / NAME, folder_provenance(self.made_with, folder, written))
        if self.store is not None:
            self.store.drop()

    def _write_recordings(self, folder: Path) -> list[Path]:
        """Write recordings with the truth beside each; return the paths."""
        written = []
        for payload in self.plan.payloads:
            for preset in self.plan.presets:
                units = draw_units(payload, preset_named(preset), self.plan.seed)
                for recording in self.result.recordings[preset][payload]:
                    trial = recording.metadata.trial
                    number = int(recording.name.split("_")[1].removeprefix(trial))
                    effects = scattering(payload, trial, number) if preset == SCATTERED else ()
                    truth = GroundTruth.of(apply_effects(build_team(payload, units), effects))
                    path = folder / f"{recording.name}.parquet"
                    write_recording(recording, path)
                    write_truth(truth, path)
                    written += [path, truth_path(path)]
        return written


def run_experiment(options: Paper, tell: Callable[[float, float, str], object]) -> Experiment:
    """Run the paper's experiment, or resume an interrupted run in its folder.

    Args:
        options: options of the experiment; ``force`` deletes partial results of a run with other options.
        tell: called with the amount done, the total amount and the name of the current stage.

    Raises:
        InputError: an option is invalid.
        TrialError: the physics of a trial cannot be trusted.
    """
    plan = PaperPlan(
        options.payload, options.preset, options.trials, options.seed, staged_only=options.staged_only
    )
    made_with = provenance("paper", options)
    store = Store(options.out, run_key(asdict(plan)), force=options.force) if options.out else None
    with workers_of(options.scheduler):
        result = run_paper(plan, options.jobs, tell, store, remote=options.scheduler is not None)
    return Experiment(plan, result, made_with, store)
