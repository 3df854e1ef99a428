"""What ``mocobot simulate`` refuses at once."""

from pathlib import Path
from typing import get_args

from estimator.errors import InputError
from estimator.written import holds
from mocobot.api.fits import check_fits
from mocobot.files.targets import check_folder, check_output
from mocobot.options import Simulate
from mocobot.options.simulation import Kind
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.scene.model_files import payload_path
from mocobot_sim.trial.sidecar import truth_path

KINDS = get_args(Kind)


def check(options: Simulate) -> None:
    """Everything that can be refused before a team is built, the effects' numbers among it.

    Raises:
        InputError: an option or an output that cannot be met.
    """
    kinds = kinds_of(options)
    given = Path(options.payload or "")
    inputs = [*([given] if given.is_file() else []), *([options.units] if options.units else [])]
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
        from mocobot_sim.effects.spec import parse_effect  # numpy, and a file for each effect

        for text in options.effect:
            parse_effect(text)


def kinds_of(options: Simulate) -> list[str]:
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
    kinds = options.trials.split(",")
    for kind in kinds:
        if kind not in KINDS:
            raise InputError(
                f"--trials is {options.trials!r}; it must be a list such as random,random,periodic,static of "
                f"{', '.join(KINDS)}"
            )
    return kinds
