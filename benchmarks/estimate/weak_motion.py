"""Errors over standard errors of estimates from weak motion.

    python benchmarks/estimate/weak_motion.py

Five kinds of recordings with nominal sensors: the payload only yaws; it is held still at tilts; it turns about one
axis; two seconds of random vias; random vias with one robot's wrist still. Prints, for every reported number and kind,
the root mean square of error over standard error, and how many there are.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import chain

import numpy as np
import tyro
from scipy.spatial.transform import Rotation

import mocobot
from estimator.arrays import Array, inertia_parameters
from estimator.recording.model import Recording
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial import trajectories as paths
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth

KINDS = ("yaw", "static", "axis", "2 s", "one still")
TRIM_S = 2.0
"""Dropped by the estimator at either end."""


def main(seed: int = 6262, each: int = 12) -> None:
    """Simulate, estimate, print the table."""
    scores: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for kind in KINDS:
        for number in range(each):
            rng = np.random.default_rng([seed, KINDS.index(kind), number])
            recording, truth = recorded(kind, "abcd"[number % 4], rng)
            try:
                estimate = mocobot.estimate([recording])
            except mocobot.InputError as error:
                print(f"{kind} {number}: {error}")
                continue
            for name, value in scored(estimate, truth).items():
                scores[name][kind].append(value)
    print(f"{'':<8}" + "".join(f"{kind:>14}" for kind in (*KINDS, "all")))
    for name, by_kind in scores.items():
        parts = [by_kind[kind] for kind in KINDS]
        print(f"{name:<8}" + "".join(cell(part) for part in (*parts, list(chain(*parts)))))
    of_kind = [[z for by_kind in scores.values() for z in by_kind[kind]] for kind in KINDS]
    print(f"{'all':<8}" + "".join(cell(part) for part in (*of_kind, list(chain(*of_kind)))))


def cell(z: list[float]) -> str:
    """Their rms, and how many there are."""
    return f"{np.sqrt(np.mean(np.square(z))):>8.2f} ({len(z):>3})" if z else f"{'-':>8} (  0)"


def recorded(kind: str, payload: str, rng: np.random.Generator) -> tuple[Recording, GroundTruth]:
    """A recording of a kind, and the truth."""
    scene = build_team(payload)
    path = commanded(kind, scene, rng)
    log = run_trial(scene, path)
    recording = measure(log, PRESETS["nominal"], rng, payload=payload, name=kind)
    if kind == "2 s":
        first = round((paths.SETTLE_S + rng.uniform(0.0, 2.0)) * paths.RATE_HZ)
        part = slice(first, first + round((2.0 + 2.0 * TRIM_S) * paths.RATE_HZ))
        cut = {name: getattr(recording, name)[part] for name in ("time", "phi", "theta", "tau", "ref")}
        recording = replace(recording, **cut)
    return recording, GroundTruth.of(scene)


def commanded(kind: str, scene: TeamScene, rng: np.random.Generator) -> paths.Trajectory:
    """Commands of a kind; half of the turns are sines, half go from angle to angle."""
    home, X_1i = scene.wrist_home_b, scene.X_1i
    if kind == "static":
        tilt = np.deg2rad(rng.uniform(2.0, 7.0))
        return paths.static_orientations(home, X_1i, int(rng.integers(3, 7)), tilt)
    if kind == "2 s":
        return paths.random_vias(home, rng, vias=6)
    if kind == "one still":
        path = paths.random_vias(home, rng, vias=25)
        still = rng.integers(len(home))
        path.ref_b[:, still] = home[still]
        return path
    axis = np.array([0.0, 0.0, 1.0]) if kind == "yaw" else rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    centre = X_1i.translation.mean(axis=0)
    if rng.uniform() < 0.5:
        only = paths.random_vias(np.zeros((1, 3)), rng, vias=25, box_m=(np.deg2rad(6.0), 0.0, 0.0))
        angle = only.ref_b[:, 0, 0]
    else:
        time = np.arange(4000) / paths.RATE_HZ - paths.SETTLE_S
        ramp = paths.minimum_jerk(time / 2.0) * paths.minimum_jerk((35.0 - time) / 2.0)
        angle = np.deg2rad(rng.uniform(3.0, 6.0)) * ramp * np.sin(2.0 * np.pi * rng.uniform(0.4, 0.8) * time)
    return paths.Trajectory("random", paths._turn_about(home, X_1i, centre, angle[:, None] * axis))


def scored(estimate: mocobot.Estimate, truth: GroundTruth) -> dict[str, float]:
    """Error over standard error of every number that is reported."""
    z: dict[str, Array] = {}
    if estimate.mass is not None:
        z["m"] = np.array([(estimate.mass.mass - truth.mass_kg) / estimate.mass.se])
    if estimate.p_1c is not None and estimate.p_1c_covariance is not None:
        z["c"] = (estimate.p_1c - truth.p_1c) / np.sqrt(np.diag(estimate.p_1c_covariance))
    if estimate.inertia is not None:
        matrix = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
        error = inertia_parameters(estimate.inertia.inertia - matrix)
        z["I"] = error / np.sqrt(np.diag(estimate.inertia.covariance))
    if estimate.grasps is not None:
        se = np.sqrt(np.diag(estimate.grasps.covariance)).reshape(-1, 6)
        for j in range(1, estimate.grasps.robots):
            turned = Rotation.from_matrix(truth.R_1i[j] @ estimate.grasps.R_1i[j].T).as_rotvec()
            z[f"R1{j + 1}"] = turned / se[j - 1, :3]
            z[f"p1{j + 1}"] = (truth.p_1i[j] - estimate.grasps.p_1i[j]) / se[j - 1, 3:]
    names = {1: ("",), 3: ("x", "y", "z"), 6: ("xx", "xy", "xz", "yy", "yz", "zz")}
    return {
        f"{name}{part}": float(value)
        for name, values in z.items()
        for part, value in zip(names[len(values)], values, strict=True)
    }


if __name__ == "__main__":
    tyro.cli(main)
