"""Hide friction in one joint of a simulated team, and let the recordings tell: what is wrong, where, and how much.

python scenarios/hidden_effect.py
python scenarios/hidden_effect.py FOLDER    # keeps the recordings, for `mocobot diagnose`
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from discrepancy.engine.diagnose import diagnose
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.text import format_diagnosis
from discrepancy.team.estimates import estimates
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.words import TeamWords
from estimator.estimate.payload import estimate_payload
from estimator.recording.parquet import write_recording
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial


def main(folder: Path | None = None) -> None:
    """Two trials of payload (b) with 16-bit encoders and noisy torques; nobody tells the diagnosis what is hidden."""
    rng, nominal = np.random.default_rng(5), sensor_preset("nominal")
    friction = make_effect(
        "joint_friction", {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}, robot=2, joint=1
    )
    team = build_team("b")
    motions = [
        random_vias(team.wrist_home_b, rng, vias=20),
        sphere_motion(team.wrist_home_b, team.X_1i, duration_s=25.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        log = run_trial(apply_effects(build_team("b"), [friction]), motion, trial_number=number)
        recordings.append(measure(log, nominal, rng, name=f"trial {number}"))

    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        for recording in recordings:
            write_recording(recording, folder / f"{recording.name.replace(' ', '')}.parquet")
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    diagnosis = diagnose(rig)
    values = diagnosis_to_dict(diagnosis, rig, TeamWords(), estimates(rig, diagnosis.explanation))
    print(format_diagnosis(values))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
