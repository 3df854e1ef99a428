"""``mocobot simulate``: simulate one trial, write its recording and the truth beside it."""

from pathlib import Path

from estimator.errors import InputError
from mocobot.api.simulation import check_fits, simulate
from mocobot.files.targets import check_output
from mocobot.options import Simulate
from mocobot.progress import share_bar
from mocobot_sim.trial.trajectories import RATE_HZ
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
    check_fits("--vias", options.vias, ("random", "free"), options.trajectory)
    check_fits("--duration", options.duration, ("periodic",), options.trajectory)
    check_fits("--robots", options.robots, ("free",), options.trajectory)
    if options.payload is not None and options.robots is not None:
        raise InputError("--payload and --robots are both given; a payload says how many robots there are")
    if options.model is not None and options.payload is not None:
        raise InputError(
            "--payload and --model are both given; the model has its own payload, so leave one out"
        )
    with share_bar(f"{options.trajectory} trial", "s") as tell:

        def advance(done: int, samples: int) -> None:
            tell(done / RATE_HZ, samples / RATE_HZ, "")

        done = simulate(
            options.payload, options.trajectory,
            vias=options.vias, duration_s=options.duration, preset=options.preset, seed=options.seed,
            model=options.model, level=options.level, robots=options.robots, progress=advance,
        )  # fmt: skip
    done.write(options.out)
    print(f"{options.out}: {done.time[-1]:.1f} s of {options.trajectory} motion, {options.preset} sensors")
