"""Carry payload (b) with uncalibrated robots, estimate it, and write a replay of estimate against truth.

python scenarios/replay_estimate.py [replay.rrd], then: rerun replay.rrd
"""

from __future__ import annotations

import sys
from pathlib import Path

from estimator.estimate.payload import estimate_payload
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.placement import Grasps
from mocobot_view.replay.outputs import save_replay
from mocobot_view.replay.replay_trial import replay_trial


def main(target: Path) -> None:
    """One periodic trial of 20 s; encoders are off by about 1 deg, lengths by 1 mm, springs by 2 %."""
    done = simulate(TrialRequest("b", "periodic", duration_s=20), [sensor_preset("uncalibrated")])
    recording, true = done.recordings["uncalibrated"], done.truth
    truth = BodyFacts(Grasps(true.R_1i, true.p_1i), true.mass_kg, true.p_1c, true.R_1c, true.principal_kgm2)
    trial = replay_trial(recording, "uncalibrated", estimate_payload([recording]), truth)
    save_replay([trial], target)
    print(f"{target}: {target.stat().st_size / 1e6:.1f} MB; open it with: rerun {target}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("replay.rrd"))
