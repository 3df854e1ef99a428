"""Recordings of a simulated EMPS axis with known causes, made with a finer step than the diagnosis uses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from discrepancy.emps.recording.axis_log import AxisLog
from emps_data import VARIABLE, data_folder
from mocobot_sim.emps import loop
from mocobot_sim.emps.loop import Start, run
from mocobot_sim.emps.plant import ForcePush, Plant

GAIN, KP, KV, RATE_HZ = 35.15065188248547, 160.18, 243.45, 1000.0
CYCLE_S, CYCLES = 2.4, 3
STEP_M = 2e-7
FINE_S = 2.5e-4


def nominal() -> Plant:
    """The axis as the diagnosis assumes it."""
    return Plant(100.0, GAIN, KP, KV, 1.0 / RATE_HZ, 10.0)


def reference(cycles: int = CYCLES) -> np.ndarray:
    """Trapezoids of velocity at three speeds, out and back, over and over [m], shape (Q,)."""
    time = np.arange(round(CYCLE_S * RATE_HZ)) / RATE_HZ
    knots = np.array([0.0, 0.05, 0.25, 0.30, 0.55, 0.60, 1.05, 1.20])
    speed = np.array([0.0, 0.04, 0.04, 0.08, 0.08, 0.12, 0.12, 0.0])
    half = np.interp(time[: len(time) // 2], knots, speed)
    velocity = np.concatenate([half, -half])
    x = np.cumsum(velocity) / RATE_HZ
    return np.tile(x - x[-1] * np.arange(len(x)) / len(x), cycles)


@cache
def recorded(plant: Plant, seed: int = 0, cycles: int = CYCLES, name: str = "made.mat") -> AxisLog:
    """A recording of a plant: fine integration, quantised position, a little friction noise.

    The noise is force noise, other in every cycle: a few small random kicks of the carriage.
    """
    rng = np.random.default_rng(seed)
    q = reference(cycles)
    time = np.arange(len(q)) / RATE_HZ
    kicks = tuple(
        ForcePush(float(t), 0.01, float(f))
        for t, f in zip(np.arange(0.0, time[-1], 0.01), 0.5 * rng.standard_normal(10**4), strict=False)
    )
    before = loop.TIMESTEP_S
    loop.TIMESTEP_S = FINE_S
    try:
        start = Start(float(q[0]), 0.0, np.zeros(4), np.zeros(4))
        x, volts = run(replace(plant, pushes=(*plant.pushes, *kicks)), time, q, start)
    finally:
        loop.TIMESTEP_S = before
    x = np.round(x / STEP_M) * STEP_M
    return AxisLog(name, time, x, q, volts, GAIN, KP, KV, np.ones(len(q), dtype=bool))


def as_mat(log: AxisLog) -> dict[str, np.ndarray | float]:
    """The recording as the variables of a MAT file."""
    return {
        "t": log.time[:, None], "qm": log.position[:, None], "qg": log.reference[:, None],
        "vir": log.voltage[:, None], "gtau": log.gain_N_per_V, "kp": log.kp_per_s, "kv": log.kv_Vs_per_m,
    }  # fmt: skip


def written(folder: Path, log: AxisLog, **changes: object) -> Path:
    """A MAT file of a recording, some variables changed; None leaves one out."""
    values = {k: v for k, v in (as_mat(log) | changes).items() if v is not None}
    path = folder / log.name
    savemat(path, values)
    return path


def needed_data() -> Path:
    """The benchmark's recordings; skips the test where they are not."""
    folder = data_folder()
    if folder is None:
        pytest.skip(f"the EMPS benchmark's recordings are not here; set {VARIABLE} to their folder")
    return folder
