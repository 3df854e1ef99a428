"""Errors over standard errors of estimates from bases that drive while they carry.

    python benchmarks/driving.py [--trials 20] [--ratio 0.01] [--payload a]

Every trial is a random one of a team whose bases wander by wheel odometry with errors of scale (``ratio`` is their
standard deviation), estimated alone: with the measured motion of the bases, and as if they stood.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import tyro
from scipy.spatial.transform import Rotation

import mocobot

QUANTITIES = ("R [deg]", "p [mm]", "mass [g]", "centre of mass [mm]", "principal moments [%]")


def main(
    trials: int = 20, ratio: float = 0.01, payload: str = "a", vias: int = 40, first: int = 9000
) -> None:
    """Simulate, estimate, print one line a trial, then the table."""
    rows = []
    for seed in range(first, first + trials):
        try:
            recording = mocobot.simulate(payload, "random", seed=seed, vias=vias, drive=ratio)
        except mocobot.TrialError as error:
            print(f"{seed} left out: {error}", flush=True)
            continue
        estimate = mocobot.estimate([recording])
        rows.append(errors(recording.truth.to_dict(), estimate))
        z = ", ".join(f"{np.sqrt(np.mean((e / se) ** 2)):.2f}" for e, se in rows[-1])
        print(f"{seed} {estimate.method:<7} error over standard error: {z}; p {size(rows[-1][1][0]):.3f} mm; "
              f"as if bases stood: p {standing(recording)} mm", flush=True)  # fmt: skip
    print(f"\n{'':<24}{'rms error':>12}{'rms standard error':>20}{'rms of error over standard error':>34}")
    for k, name in enumerate(QUANTITIES):
        e, se = (np.array([row[k][part] for row in rows]) for part in (0, 1))
        print(f"{name:<24}{size(e):>12.3g}{size(se):>20.3g}{size(e / se):>34.2f}")
    e, se = (np.concatenate([np.concatenate([one[part] for one in row]) for row in rows]) for part in (0, 1))
    print(f"{'all numbers':<24}{'':>12}{'':>20}{size(e / se):>34.2f}")


def errors(truth: dict, estimate: mocobot.PayloadEstimate) -> list[tuple[np.ndarray, np.ndarray]]:
    """Errors and standard errors of every quantity, in its unit."""
    grasps, N = estimate.grasps, len(truth["grasps"])
    se = np.sqrt(np.diag(grasps.covariance)).reshape(N - 1, 2, 3)
    turned, apart = [], []
    for i, true in enumerate(truth["grasps"][1:], start=1):
        R = Rotation.from_rotvec(true["R_1i_rotvec_deg"], degrees=True)
        turned.append((R * Rotation.from_matrix(grasps.R_1i[i]).inv()).as_rotvec(degrees=True))
        apart.append(1e3 * (np.array(true["p_1i_m"]) - grasps.p_1i[i]))
    com = 1e3 * (estimate.p_1c - truth["p_1c_m"]), 1e3 * np.sqrt(np.diag(estimate.p_1c_covariance))
    found, moments = estimate.inertia.principal, np.array(truth["principal_inertia_kgm2"])
    return [
        (np.ravel(turned), np.rad2deg(se[:, 0]).ravel()),
        (np.ravel(apart), 1e3 * se[:, 1].ravel()),
        (np.array([1e3 * (estimate.mass.mass - truth["mass_kg"])]), np.array([1e3 * estimate.mass.se])),
        com,
        (100 * (found.moments - moments) / moments, 100 * found.moments_se / moments),
    ]


def standing(recording: mocobot.SimulatedRecording) -> str:
    """Error of p [mm] if the motion of the bases is left out, rms of the components."""
    try:
        estimate = mocobot.estimate([replace(recording, base=None)])
        return f"{size(errors(recording.truth.to_dict(), estimate)[1][0]):.1f}"
    except (mocobot.InputError, AttributeError, TypeError):
        return "-"


def size(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


if __name__ == "__main__":
    tyro.cli(main)
