"""How near the Cramer-Rao bound the estimates of payloads of two bodies are, and whether their errors are as claimed.

    python benchmarks/two_bodies.py --trials 10                      # hinged, sliding, flexible and folding
    python benchmarks/two_bodies.py --payloads hinged --trials 30 --first 1000

Every trial is a fresh simulation of a random motion, read once with white noise of the preset's size. The bound is that
of the raw samples at the full rate, as in efficiency.py: grasps, joint, bases and parameters are unknown, and the rates
and accelerations of the noise-free motion are known. NEES is the squared error of all inertial parameters and of the
joint's terms over the claimed covariance; its sum is chi-squared where the covariance is right.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tyro
from scipy.stats import chi2

from efficiency import _instants
from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.rows import Sensing
from estimator.recording.model import Recording
from estimator.two_bodies import estimate as two
from estimator.two_bodies.fit import Fitted, TrialRows, evaluate, normal
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.simulate import TrialRequest, simulate

STRIDE = 5
"""As in efficiency.py."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        payloads: their names.
        trials: number of fresh trials of each.
        first: seed of the first trial; the others follow.
        step_s: integration step [s]. MuJoCo takes dampers implicitly, which adds half the step times the damping to
            the inertia about the joint: with 1 ms, half a standard error of `flexible`.
    """

    payloads: tuple[str, ...] = ("hinged", "sliding", "flexible", "folding")
    trials: int = 10
    first: int = 500
    step_s: float = 5e-4


KIND = {"folding": "hinged"}


def main(options: Options) -> None:
    """Print one line for each payload."""
    print(
        "| payload | trials | axis | pivot | first body | second body | joint | NEES (99 % band) | CPU [s] |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for payload in options.payloads:
        squares: list[Array] = []
        nees, count, cpu = 0.0, 0, 0.0
        for seed in range(options.first, options.first + options.trials):
            one = trial(payload, seed, options.step_s)
            squares.append(one.ratios**2)
            nees, count, cpu = nees + one.nees, count + one.count, cpu + one.cpu
        ratios = np.sqrt(np.mean(squares, axis=0))
        low, high = chi2.ppf([0.005, 0.995], count) / count
        shown = " | ".join("" if np.isnan(x) else f"{x:.2f}" for x in ratios)
        print(
            f"| {payload} | {options.trials} | {shown} | {nees / count:.2f} ({low:.2f}-{high:.2f}) | "
            f"{cpu / options.trials:.0f} |",
            flush=True,
        )


@dataclass(frozen=True)
class Scored:
    """One trial: rms error over bound of axis, pivot, first and second body and joint; NEES, its count; CPU time."""

    ratios: Array
    nees: float
    count: int
    cpu: float


def trial(payload: str, seed: int, step_s: float) -> Scored:
    """Simulate, read and estimate one trial."""
    scene = build_team(payload, timestep_s=step_s)
    done = simulate(TrialRequest(payload, "random", seed), [PRESETS["nominal"]], scene=scene)
    truth = done.truth.to_dict()
    preset = PRESETS["nominal"]
    assert preset.encoder_bits is not None
    step = 2.0 * np.pi / 2**preset.encoder_bits
    sigma = np.repeat([step, step, preset.tau_step_Nm], 3) / np.sqrt(12.0)
    sigma[6:] = np.hypot(sigma[6:], preset.tau_noise_Nm)
    rng = np.random.default_rng([seed, 2])
    quiet = measure(done.log, PRESETS["ideal"], rng, payload=payload, name="random")
    shape = quiet.phi.shape
    read = replace(
        quiet,
        phi=quiet.phi + sigma[:3] * rng.standard_normal(shape),
        theta=quiet.theta + sigma[3:6] * rng.standard_normal(shape),
        tau=quiet.tau + sigma[6:] * rng.standard_normal(shape),
    )
    kept: list[Fitted] = []
    solve: Any = two.solve

    def keep(*args: Any) -> Fitted:
        kept.append(solve(*args))
        return kept[-1]

    start = time.process_time()
    two.solve = keep
    try:
        found = two.estimate_two_bodies([read], KIND.get(payload, payload))  # type: ignore[arg-type]
    finally:
        two.solve = solve
    cpu = time.process_time() - start
    bound = least_covariance(quiet, kept[-1], sigma)
    error = found.parameters - found.true_parameters(truth)
    at = kept[-1].point.pair.of_joint
    of_joint, own = bound[at, at], np.diag(bound)[kept[-1].point.pair.size :]
    n = 10, len(found.names) - len(found.law)
    axis, joint = np.array(truth["joint"]["axis_1"]), truth["joint"]
    off = np.linalg.norm(np.cross(axis, found.axes[:, 0])) / np.sqrt(np.trace(of_joint[5:7, 5:7]))
    apart = np.nan
    if found.pivot is not None:
        apart = np.linalg.norm(np.cross(axis, found.pivot - np.array(joint["pivot_1_m"])))
        apart = apart / np.sqrt(np.trace(of_joint[7:9, 7:9]))
    parts = (slice(0, n[0]), slice(*n), slice(n[1], None))
    ratios = [off, apart, *(np.sqrt(np.mean(error[part] ** 2 / own[part])) for part in parts)]
    nees = float(error @ np.linalg.solve(found.covariance, error))
    return Scored(np.array(ratios), nees, len(error), cpu)


def least_covariance(quiet: Recording, fitted: Fitted, sigma: Array) -> Array:
    """Return the Cramer-Rao bound of all unknowns of a fit, from the noise-free samples."""
    labels = quiet.metadata
    units = ArmUnit(labels.design, np.zeros((labels.robots, COUNT)))
    still = np.zeros((labels.robots, 9))
    H = np.zeros((fitted.point.size,) * 2)
    for rows in _instants(quiet, 500):
        samples = TrialRows(
            "quiet", rows, units, Sensing(still, np.tile(sigma, (labels.robots, 1))), rows.time
        )
        H += STRIDE * normal([evaluate(fitted.point, 0, samples)], fitted.point.size)[0]
    scale = 1.0 / np.sqrt(np.diag(H))
    return np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)


if __name__ == "__main__":
    main(tyro.cli(Options))
