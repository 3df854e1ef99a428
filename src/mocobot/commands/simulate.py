"""``mocobot simulate``: simulate one trial, write its recording and the truth beside it."""

from pathlib import Path

from estimator.errors import InputError
from mocobot.api.simulation import check_fits, simulate
from mocobot.files.targets import check_output
from mocobot.options import Simulate
from mocobot.progress import bar
from mocobot_sim.trial.truth import truth_path


def run(options: Simulate) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met, or an output that cannot be written.
        TrialError: the physics of the trial cannot be trusted.
    """
    given = Path(options.payload or "")
    inputs = [given] if given.is_file() else []
    check_output(options.out, inputs, force=options.force, suffix=".parquet")
    check_output(truth_path(options.out), inputs, force=options.force)
    check_fits("--vias", options.vias, "random", options.trajectory)
    check_fits("--duration", options.duration, "periodic", options.trajectory)
    if options.model is not None and options.payload is not None:
        raise InputError(
            "--payload and --model are both given; the model has its own payload, so leave one out"
        )
    with bar(None, "simulating", "sample") as advance:
        done = simulate(
            options.payload, options.trajectory,
            vias=options.vias, duration_s=options.duration, preset=options.preset, seed=options.seed,
            model=options.model, level=options.level, progress=advance,
        )  # fmt: skip
    done.write(options.out)
    print(f"{options.out}: {done.time[-1]:.1f} s of {options.trajectory} motion, {options.preset} sensors")
