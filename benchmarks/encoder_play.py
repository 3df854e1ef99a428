"""Blind sets with play in one gimbal encoder, and sets without any: named, falsely certain, and errors of the size.

    python benchmarks/encoder_play.py [--first 7000] [--draws 20] [--clean 6]

Each set is two random trials of payload (a), (b) or (c), some 25 s each, with the sensors of the preset ``nominal``.
The play is 1 to 5 mrad, evenly in logarithm, at any robot and gimbal axis. Each set is diagnosed once.
"""

from __future__ import annotations

import time

import numpy as np
import tyro

import mocobot

CERTAIN = 0.9


def main(first: int = 7000, draws: int = 20, clean: int = 6, vias: int = 20) -> None:
    """Simulate, diagnose, print one line a set, then the table."""
    named, certain, off, spent = [0, 0], [0, 0], [], []
    for k in range(draws + clean):
        seed, hidden = first + k, k < draws
        rng = np.random.default_rng([seed, 77])
        payload = "abc"[rng.integers(3)]
        robot, joint = int(rng.integers(1, 4)), int(rng.integers(1, 4))
        play_rad = 1e-3 * float(5.0 ** rng.uniform())
        effect = f"encoder_play:robot={robot},joint={joint},play_rad={play_rad:.6g}"
        recordings = mocobot.simulate_trials(
            payload, ["random", "random"], seed=seed, vias=vias, effects=(effect,) if hidden else ()
        )
        start = time.process_time()
        found = mocobot.diagnose(recordings, closed_loop=False).to_dict()
        spent.append(time.process_time() - start)
        right, wrong, words = False, [], f"play of {1e3 * play_rad:.3f} mrad at {robot}.{joint}"
        for one in found["causes"]:
            at = one["cause"], one["robot"], one["joint"]
            if hidden and at == ("encoder_play", robot, joint):
                right = True
                value, se = (one["parameters"]["play_rad"][name] for name in ("value", "se"))
                off.append((value - play_rad) / se)
                words += f"; found {1e3 * value:.3f} +- {1e3 * se:.3f}"
            elif one["probability"] >= CERTAIN:
                wrong.append(at)
        named[not hidden] += right
        certain[not hidden] += bool(wrong)
        print(f"{seed} ({payload}) {words if hidden else 'nothing'}; {found['verdict']}; wrong: {wrong}; "
              f"{spent[-1]:.0f} s", flush=True)  # fmt: skip
    print(f"\nplay: {named[0]} of {draws} named, {certain[0]} falsely certain; "
          f"none: {certain[1]} of {clean} falsely certain")  # fmt: skip
    rms = np.sqrt(np.mean(np.square(off))) if off else np.nan
    print(
        f"error of the size over its standard error: rms {rms:.2f}, largest {np.max(np.abs(off), initial=0.0):.1f}"
    )
    print(f"CPU of a diagnosis: median {np.median(spent):.0f} s, most {np.max(spent):.0f} s")


if __name__ == "__main__":
    tyro.cli(main)
