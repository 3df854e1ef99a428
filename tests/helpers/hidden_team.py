"""Short trials of a team in which something is hidden: a random one, and a periodic one; at 1 ms to save time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.recording.model import Recording
from mocobot_sim.effects import Effect, apply_effects
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial


def recorded(payload: str, effects: Sequence[Effect] = (), *, seed: int, vias: int = 8) -> list[Recording]:
    """Two trials; equal arguments give equal bits."""
    rng, sensors, home = np.random.default_rng(seed), sensor_preset("nominal"), build_team(payload)
    motions = [
        random_vias(home.wrist_home_b, rng, vias=vias),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=10.0, rng=rng),
    ]
    out = []
    for number, motion in enumerate(motions, start=1):
        scene = apply_effects(build_team(payload, timestep_s=1e-3), effects)
        log = run_trial(scene, motion, trial_number=number)
        out.append(measure(log, sensors, rng, name=f"trial {number}"))
    return out
