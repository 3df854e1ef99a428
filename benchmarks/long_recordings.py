"""Long recordings of three robots each, diagnosed by a choice of parts: nothing, friction, or a push is in them.

    python benchmarks/long_recordings.py --first 21 --draws 6 --out DIR

Payloads, robots and what is hidden follow in turn from the seed; a push of 0.64 N lasts 10 s and begins anywhere.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

import growth
import mocobot

PUSH_S = 10.0
FORCE_N, POINT_M = (0.4, -0.4, 0.3), (-0.3, 0.2, 0.0)
TURN = (("b", "nominal"), ("c", "uncalibrated"), ("ring", "nominal"))


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        first: seed of the first.
        draws: how many.
        minutes: of each.
        pushed: whether there is a push in every one, not in every other three.
        out: where recordings are kept.
    """

    first: int = 100
    draws: int = 6
    minutes: float = 20.0
    pushed: bool = False
    out: Path = Path("out/long")


def run(seed: int, turn: int, options: Options) -> None:
    """Simulate one, unless it is there, and diagnose it."""
    payload, preset = TURN[turn % len(TURN)]
    seconds, out = 60.0 * options.minutes, options.out
    rng, effects, said = np.random.default_rng(seed), [], "nothing"
    if payload == "ring":
        effects, said = [mocobot.make_effect("joint_friction", growth.FRICTION, robot=2, joint=1)], "friction"
    if options.pushed or turn // len(TURN) % 2:
        start_s = float(rng.uniform(5.0, seconds - 20.0))
        force = {f"force_{a}_N": x for a, x in zip("xyz", FORCE_N, strict=True)}
        point = {f"point_{a}_m": x for a, x in zip("xyz", POINT_M, strict=True)}
        when = {"trial": 1, "start_s": start_s, "duration_s": PUSH_S}
        effects.append(mocobot.make_effect("push", when | force | point))
        said += f", a push from {start_s:.1f} s on"
    path = out / f"{seed}.parquet"
    if not path.is_file():
        given: Path | str = payload
        if payload == "ring":
            given = out / "ring.xml"
            given.write_text(growth.ring_mjcf(3), encoding="utf-8")
        vias = round(seconds / growth.VIA_S)
        trial = mocobot.simulate(given, "random", vias=vias, seed=seed, preset=preset, effects=effects)
        mocobot.write_recording(trial, path)
    begun = time.process_time()
    found = mocobot.diagnose([path], closed_loop=False, laws="never")
    print(
        f"{seed} {payload} {preset}, hidden {said}: {found.verdict}, {time.process_time() - begun:.0f} s of CPU"
    )
    for entry in (*found.causes, *(note for note in found.to_dict()["notes"] if "parts" in note)):
        print(f"    {getattr(entry, 'sentence', entry)}", flush=True)


def main(options: Options) -> None:
    """Run all."""
    options.out.mkdir(parents=True, exist_ok=True)
    for turn in range(options.draws):
        run(options.first + turn, turn, options)


if __name__ == "__main__":
    main(tyro.cli(Options))
