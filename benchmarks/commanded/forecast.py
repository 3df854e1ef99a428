"""Forecasts of a run from its commands alone, by MuJoCo, and what they are off.

A window begins at the measured state: a cubic through the positions of 20 ms either side (two rows at least). What no
encoder sees, such as a stand, begins where the same model is at that time of a forecast of the whole run.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from mujoco import rollout

from commanded.bodies import STEP_S
from commanded.drives import ControlLaw, actuate
from commanded.machine import SETTLE_S, Array, Machine, addresses, arriving, run

WINDOWS_S = (0.5, 1.0)
AROUND_S = 0.02
Simulated = Callable[[Array, float, int], Array]
"""Starts (nq + nv), time of it, number of rows that follow: MuJoCo's states at them, shape (rows, nq + nv)."""


@dataclass(frozen=True)
class Log:
    """A log as the benchmark reads it.

    Attributes:
        stamps: [s], shape (n,).
        q: positions [rad], shape (n, J).
        command: [rad], shape (n, J).
    """

    stamps: Array
    q: Array
    command: Array


def read_log(path: Path, joints: tuple[str, ...]) -> Log:
    """A log of a set."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    q, command = (np.column_stack([table[f"{j}_{n}_rad"] for j in joints]) for n in ("position", "command"))
    return Log(table["time_s"], q, command)


def told_law(folder: Path) -> tuple[tuple[str, ...], ControlLaw]:
    """Joints and the control law that the map of a set has when it is written."""
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    numbers = (np.array(truth["told"][name], float) for name in ("kp", "kd", "limit"))
    return tuple(truth["joints"]), ControlLaw(*numbers, apart=truth["kind"] == "arm")


def compiled(path: Path, joints: tuple[str, ...], law: ControlLaw | None) -> mujoco.MjModel:
    """A model with a control law in place of its actuators, or with its own, to be stepped by RK4 at 0.5 ms."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for own in [*spec.sensors, *(spec.actuators if law is not None else ())]:
        spec.delete(own)
    for own in spec.actuators:
        own.delay, own.nsample = 0.0, 0  # delays are told beside the model
    if law is not None:
        actuate(spec, joints, law)
    return spec.compile()


def by_rollout(m: mujoco.MjModel, joints: tuple[str, ...], log: Log, delay_s: float | Array) -> Simulated:
    """A model with actuators whose first controls are the joints' commands."""
    period = (log.stamps[-1] - log.stamps[0]) / (len(log.stamps) - 1)
    data = mujoco.MjData(m)

    def simulated(start: Array, first: float, rows: int) -> Array:
        step = m.opt.timestep
        count = int(np.ceil(rows * period / step - 1e-9))
        times = step * np.arange(count + 1)
        control = np.zeros((1, count, m.nu))
        control[0, :, : len(joints)] = arriving(log.stamps, log.command, delay_s, first + times)
        begin = np.concatenate(([0.0], start, np.zeros(m.na)))[None]
        with rollout.Rollout(nthread=1) as own:
            states, _ = own.rollout([m], [data], begin, control)
        states = np.vstack((start, np.asarray(states)[0, :, 1 : 1 + m.nq + m.nv]))
        wanted = period * np.arange(1, rows + 1)
        return np.column_stack([np.interp(wanted, times, x) for x in states.T])

    return simulated


def by_machine(machine: Machine, log: Log) -> Simulated:
    """The true machine."""
    period = (log.stamps[-1] - log.stamps[0]) / (len(log.stamps) - 1)

    def simulated(start: Array, first: float, rows: int) -> Array:
        if first < 0.0:  # settles before the log begins
            return run(machine, log.stamps[:2], log.command[:2]).state[:1]
        ran = run(machine, log.stamps, log.command, start, first, rows * period + 1e-9)
        return ran.state[1 : rows + 1]

    return simulated


def errors(
    m: mujoco.MjModel,
    joints: tuple[str, ...],
    simulated: Simulated,
    log: Log,
    windows_s: tuple[float, ...] = WINDOWS_S,
) -> dict[str, Array]:
    """Rms of forecast minus measured position per joint [rad], by ``0.5 s``, ``1 s`` and ``whole``, shape (J,) each."""
    at, dof, adds = addresses(m, joints)
    n = len(log.stamps)
    period = (log.stamps[-1] - log.stamps[0]) / (n - 1)
    hidden = np.zeros(m.nq + m.nv)
    hidden[: m.nq] = m.qpos0
    if m.nv > len(joints):
        hidden[at] = log.q[0]
        hidden = simulated(hidden, -SETTLE_S, round(SETTLE_S / period))[-1]

    def begun(at_row: int, hidden: Array) -> Array:
        start = hidden.copy()
        q, dq = measured(log, at_row)
        start[at] += q - adds @ start[: m.nq]
        start[m.nq + dof] = dq
        return start

    whole = np.vstack((hidden, simulated(begun(0, hidden), 0.0, n - 1)))
    out = {}
    for seconds in windows_s:
        rows, off = round(seconds / period), []
        for row in range(0, n - rows, rows):
            states = simulated(begun(row, whole[row]), row * period, rows)
            off.append(states[:, : m.nq] @ adds.T - log.q[row + 1 : row + 1 + rows])
        out[f"{seconds:g} s"] = np.sqrt(np.mean(np.vstack(off) ** 2, axis=0))
    off = whole[1:, : m.nq] @ adds.T - log.q[1:]
    out["whole"] = np.sqrt(np.mean(off**2, axis=0))
    return out


def measured(log: Log, row: int) -> tuple[Array, Array]:
    """Positions and speeds at a row, by a cubic (a line at the run's ends) through the rows around."""
    n = len(log.stamps)
    period = (log.stamps[-1] - log.stamps[0]) / (n - 1)
    reach = max(2, round(AROUND_S / period))
    low, high = max(0, row - reach), min(n, row + reach + 1)
    t = (np.arange(low, high) - row) * period
    order = 3 if low < row < high - 1 else 1
    fit = np.linalg.lstsq(t[:, None] ** np.arange(order + 1), log.q[low:high], rcond=None)[0]
    return fit[0], fit[1]
