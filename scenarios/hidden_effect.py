"""Hide friction in one joint of a simulated team, and diagnose from its recordings what is wrong, where, and how much.

python scenarios/hidden_effect.py
python scenarios/hidden_effect.py FOLDER    # keeps the recordings, for `mocobot diagnose`
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import mocobot
from mocobot.trajectories import random_vias, sphere_motion


def main(folder: Path | None = None) -> None:
    """Simulate two trials of payload (b) with 16-bit encoders and noisy torques, and diagnose them blind."""
    rng, nominal = np.random.default_rng(5), mocobot.PRESETS["nominal"]
    friction = mocobot.make_effect(
        "joint_friction", {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}, robot=2, joint=1
    )
    team = mocobot.build_team("b")
    motions = [
        random_vias(team.wrist_home_b, rng, vias=20),
        sphere_motion(team.wrist_home_b, team.X_1i, duration_s=25.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        faulty = mocobot.apply_effects(mocobot.build_team("b"), [friction])
        log = mocobot.run_trial(faulty, motion, trial_number=number)
        recordings.append(mocobot.measure(log, nominal, rng, name=f"trial {number}"))

    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        for recording in recordings:
            mocobot.write_recording(recording, folder / f"{recording.name.replace(' ', '')}.parquet")
    print(mocobot.diagnose(recordings))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, help="keeps the recordings, for `mocobot diagnose`")
    main(parser.parse_args().folder)
