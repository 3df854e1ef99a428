"""One effect many times: what is named, and its errors over their standard errors.

python benchmarks/independent/again.py --effect joint_friction --first 6000 --draws 24
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# As mocobot does, which is imported too late here: threads that share small matrices only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import tyro

import mocobot
from independent.generate import KINDS, generate


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        effect: what is hidden, in its plain form.
        first: seed of the first.
        draws: how many.
        size: over the limit.
        background: the robots; none are as designed.
        trials: one random trial, or four.
    """

    effect: str = "joint_friction"
    first: int = 0
    draws: int = 24
    size: float = 8.0
    background: str = "none"
    trials: Literal[1, 4] = 1


def main(options: Options) -> None:
    """Generate and diagnose, and print every verdict as it comes."""
    kinds = KINDS if options.trials == len(KINDS) else KINDS[: options.trials]
    errors: dict[str, list[float]] = {}
    for seed in range(options.first, options.first + options.draws):
        payload, hidden = "abcd"[seed % 4], [(options.effect, options.size)]
        try:
            recordings, truth = generate(
                seed, options.background, hidden, payload, noise="white", kinds=kinds
            )
        except ValueError as error:  # a name that is not known says which are
            print(error, file=sys.stderr)
            sys.exit(2)
        verdict = mocobot.diagnose(recordings, closed_loop=False, laws="never").to_dict()
        answer = truth["effects"][0]["answer"]
        at = ("cause", "robot", "joint")
        print(seed, verdict["verdict"], f"chi2/n {verdict['residual']['chi2_per_n']:.2f}")
        for cause in verdict["causes"]:
            print(f"    {cause['name']}, {cause['probability']:.0%}", flush=True)
            if all(cause.get(key) == answer.get(key) for key in at):
                for name, true in answer["known"].items():
                    told = cause["parameters"][name]
                    errors.setdefault(name, []).append((told["value"] - true) / told["se"])
                    print(f"        {name} {told['value']:.5f} +- {told['se']:.5f} ({true:.5f})", flush=True)
    for name, each in errors.items():
        rms, mean = np.sqrt(np.mean(np.square(each))), np.mean(each)
        print(f"{name}: named {len(each)} of {options.draws}, error over se {rms:.2f} rms, {mean:.2f} mean")


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
