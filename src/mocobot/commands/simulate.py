"""``mocobot simulate``: simulate trials of one team, write their recordings and the truth beside them."""

from collections.abc import Callable, Sequence
from pathlib import Path

from estimator.files import whole_folder
from mocobot.api.simulation import SimulatedRecording, simulate_trials
from mocobot.checks import simulate_kinds
from mocobot.options import Simulate
from mocobot.progress import share_bar
from mocobot_sim.effects.catalogue import parse_effect
from mocobot_sim.trial.trajectories import RATE_HZ


def run(options: Simulate) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met, or an output that cannot be written.
        TrialError: the physics of a trial cannot be trusted.
    """
    kinds = simulate_kinds(options)
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
        with whole_folder(options.out_dir, "simulation") as folder:
            for recording, name in zip(done, names, strict=True):
                recording.write(folder / name)
        for recording, name in zip(done, names, strict=True):
            print(_line(options.out_dir / name, recording, options))


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
    warning = done.log.stability and done.log.stability.warning
    line = f"{path}: {done.time[-1]:.1f} s of {done.metadata.trial} motion, {options.preset} sensors"
    return f"{line}\n{warning}" if warning else line
