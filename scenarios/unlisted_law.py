"""Hide an effect outside the catalogue in a simulated team, and identify its place and formula from recordings.

python scenarios/unlisted_law.py
python scenarios/unlisted_law.py FOLDER    # keeps the verdict: pictures, numbers, the extended model
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import mocobot
from mocobot.trajectories import random_vias, sphere_motion


def main(folder: Path | None = None) -> None:
    """Add a torque sensor error with twelve periods per turn to joint 1 of robot 2, and diagnose two trials."""
    rng, nominal = np.random.default_rng(6), mocobot.PRESETS["nominal"]
    poles = mocobot.make_effect(
        "law",
        {
            "target": "tau_2_1",
            "function": "sine",
            "of": "phi_2_1",
            "amplitude": 0.03,
            "number": 12.0,
            "phase_rad": 0.7,
        },
    )
    team = mocobot.build_team("b")
    motions = [
        random_vias(team.wrist_home_b, rng, vias=20),
        sphere_motion(team.wrist_home_b, team.X_1i, duration_s=25.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        log = mocobot.run_trial(
            mocobot.apply_effects(mocobot.build_team("b"), [poles]), motion, trial_number=number
        )
        recordings.append(mocobot.measure(log, nominal, rng, name=f"trial {number}"))

    diagnosis = mocobot.diagnose(recordings)
    print(diagnosis)
    if folder is not None:
        diagnosis.write(folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", type=Path, help="keeps the verdict: pictures, numbers, the extended model"
    )
    main(parser.parse_args().folder)
