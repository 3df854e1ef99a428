"""``mocobot simulate``: simulate trials of one team, write their recordings and the truth beside them."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from estimator.errors import InputError
from estimator.files import whole_folder
from estimator.recording.metadata import TRIALS
from mocobot.api.simulation import SimulatedRecording, check_fits, simulate_trials
from mocobot.files.targets import check_folder, check_output
from mocobot.options import Simulate
from mocobot.progress import share_bar
from mocobot_sim.effects.spec import parse_effect
from mocobot_sim.trial.trajectories import RATE_HZ
from mocobot_sim.trial.truth import truth_path

OURS = re.compile(rf"trial\d+_({'|'.join(TRIALS)})\.(parquet|truth\.json)")
"""Files in the folder of several trials."""


def run(options: Simulate) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met, or an output that cannot be written.
        TrialError: the physics of a trial cannot be trusted.
    """
    kinds = _kinds(options)
    _check(options, kinds)
    effects = [parse_effect(text) for text in options.effect]
    length = f"{len(kinds)} trials" if len(kinds) > 1 else f"{kinds[0]} trial"
    with share_bar(length, "trial" if len(kinds) > 1 else "s") as tell:
        done = simulate_trials(
            options.payload, kinds,
            vias=options.vias, duration_s=options.duration, preset=options.preset, seed=options.seed,
            effects=effects, units=options.units or (), model=options.model, level=options.level,
            robots=options.robots, progress=_progress(kinds, tell),
        )  # fmt: skip
    if options.out is not None:
        done[0].write(options.out)
        print(_line(options.out, done[0], options))
    elif options.out_dir is not None:
        names = _names(kinds)
        with whole_folder(options.out_dir) as folder:
            for recording, name in zip(done, names, strict=True):
                recording.write(folder / name)
        for recording, name in zip(done, names, strict=True):
            print(_line(options.out_dir / name, recording, options))


def _kinds(options: Simulate) -> list[str]:
    """Kind of every trial."""
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
    kinds = options.trials.split(",")
    for kind in kinds:
        if kind not in TRIALS:
            raise InputError(
                f"--trials is {options.trials!r}; it must be a list such as random,random,periodic,static of "
                f"{', '.join(TRIALS)}"
            )
    return kinds


def _check(options: Simulate, kinds: Sequence[str]) -> None:
    """Everything that can be refused before anything is simulated."""
    given = Path(options.payload or "")
    inputs = [*([given] if given.is_file() else []), *([options.units] if options.units else [])]
    if options.out is not None:
        check_output(options.out, inputs, force=options.force, suffix=".parquet")
        check_output(truth_path(options.out), inputs, force=options.force)
    elif options.out_dir is not None:
        check_folder(options.out_dir, inputs, _is_ours, "an earlier simulation", force=options.force)
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


def _is_ours(folder: Path) -> bool:
    return all(path.is_file() and OURS.fullmatch(path.name) for path in folder.iterdir())


def _names(kinds: Sequence[str]) -> list[str]:
    width = len(str(len(kinds)))
    return [f"trial{k:0{width}}_{kind}.parquet" for k, kind in enumerate(kinds, start=1)]


def _progress(
    kinds: Sequence[str], tell: Callable[[float, float, str], object]
) -> Callable[[int, int, int], object]:
    """Seconds of one trial, or trials of several."""

    def advance(trial: int, done: int, samples: int) -> None:
        if len(kinds) == 1:
            tell(done / RATE_HZ, samples / RATE_HZ, "")
        else:
            tell(trial - 1 + done / samples, len(kinds), kinds[trial - 1])

    return advance


def _line(path: Path, done: SimulatedRecording, options: Simulate) -> str:
    return f"{path}: {done.time[-1]:.1f} s of {done.metadata.trial} motion, {options.preset} sensors"
