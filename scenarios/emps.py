"""Diagnose a real machine with one linear axis, the EMPS benchmark, from its MATLAB file.

    python scenarios/emps.py [FOLDER]

FOLDER holds DATA_EMPS.mat from nonlinearbenchmark.org; the default is the variable MOCOBOT_EMPS_DATA or data/emps. If
the file is missing, the script simulates an axis with the published mass and friction instead.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import numpy as np
from scipy.io import savemat

import mocobot

ROOT = Path(__file__).resolve().parents[1]
FOLDER, NAME = ROOT / "data" / "emps", "DATA_EMPS.mat"
MASS_KG, COULOMB_N, VISCOUS_NS_PER_M, OFFSET_N = 95.1, 20.4, 203.5, -3.2
"""Published parameters: force = mass * acceleration + viscous * speed + Coulomb * sign(speed) + offset."""
GAIN_N_PER_V, KP_PER_S, KV_VS_PER_M, LIMIT_V = 35.15065188248547, 160.18, 243.45, 10.0
PERIOD_S, STEPS, ENCODER_M = 1e-3, 10, 5e-8


def reference(cycles: int = 4) -> np.ndarray:
    """Return the reference position [m], sampled every millisecond: repeated strokes at three speeds."""
    knots = np.array([0.0, 0.1, 0.8, 0.9, 1.5, 1.6, 2.2, 2.5])
    speed = np.array([0.0, 0.04, 0.04, 0.09, 0.09, 0.14, 0.14, 0.0])
    out = np.interp(np.arange(0.0, knots[-1], PERIOD_S), knots, speed)
    return np.cumsum(np.tile(np.concatenate([out, -out]), cycles)) * PERIOD_S


def simulate(path: Path) -> None:
    """Simulate the axis under its digital controller; write a file with the variables of the benchmark."""
    rng, q_ref = np.random.default_rng(0), reference()
    q, dq, step = 0.0, 0.0, PERIOD_S / STEPS
    measured, voltage = np.empty(len(q_ref)), np.empty(len(q_ref))
    for k, target in enumerate(q_ref):
        measured[k] = round(q / ENCODER_M) * ENCODER_M
        volts = KV_VS_PER_M * (KP_PER_S * (target - measured[k]) - dq)
        voltage[k] = min(max(volts, -LIMIT_V), LIMIT_V)
        rest = GAIN_N_PER_V * voltage[k] - OFFSET_N + 0.5 * rng.standard_normal()
        for _ in range(STEPS):
            free = dq + step * (rest - VISCOUS_NS_PER_M * dq) / MASS_KG
            # Dry friction reduces the speed, but cannot reverse it.
            dq = np.sign(free) * max(abs(free) - step * COULOMB_N / MASS_KG, 0.0)
            q += step * dq
    voltage += 3e-3 * rng.standard_normal(len(voltage))
    time = PERIOD_S * np.arange(len(q_ref))
    savemat(
        path, {"t": time, "qm": measured, "qg": q_ref, "vir": voltage}, oned_as="column", do_compression=True
    )


def main() -> None:
    """Inspect the log, and diagnose what the model gets wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", default=os.environ.get("MOCOBOT_EMPS_DATA", FOLDER), help=f"of {NAME}"
    )
    log = Path(parser.parse_args().folder) / NAME
    with tempfile.TemporaryDirectory() as made:
        if not log.is_file():
            print(
                f"{log} is not here; simulated: {MASS_KG} kg, {COULOMB_N} N, {VISCOUS_NS_PER_M} N s/m, {OFFSET_N} N.\n"
            )
            log = Path(made) / NAME
            simulate(log)
        model = ROOT / "models" / "emps" / "emps.xml"
        print(mocobot.inspect(log, model), "\n")
        print(mocobot.diagnose(log, model))


if __name__ == "__main__":
    main()
