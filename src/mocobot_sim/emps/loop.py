"""The axis in MuJoCo under its digital loop, and what MJCF lacks: hold, delays, ripples, pulses, pushes."""

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.arrays import Array
from mocobot_sim.emps.mjcf import DRIVE, JOINT, LOAD_JOINT, axis_spec
from mocobot_sim.emps.plant import Plant

TIMESTEP_S = 5e-4
"""Largest step of the integration, within which the voltage is held."""
STRIBECK_MPS = 1e-3
"""Below this speed the direction of friction at low speed fades."""


@dataclass(frozen=True, eq=False)
class Start:
    """State of the axis at the first sample, and what the loop remembers.

    Attributes:
        position_m, velocity_mps: of the carriage.
        velocities_mps: at samples before the first, the oldest first, shape (H,).
        voltages: at the same samples [V], shape (H,).
    """

    position_m: float
    velocity_mps: float
    velocities_mps: Array
    voltages: Array


def run(plant: Plant, time: Array, reference: Array, start: Start) -> tuple[Array, Array]:
    """Run the loop over a reference, one sample per period of the loop.

    Args:
        plant: the axis.
        time: of the samples [s], shape (Q,), even.
        reference: position that is asked for [m], shape (Q,).
        start: state at ``time[0]``.

    Returns:
        Position [m] and voltage [V], shape (Q,) each; NaN from where the simulation fails.
    """
    model = axis_spec(plant).compile()
    data = mujoco.MjData(model)
    steps = max(1, round(plant.period_s / TIMESTEP_S))
    model.opt.timestep = plant.period_s / steps
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    # The loop is digital: it gives the drive a voltage, in place of the servo that MJCF has.
    drive = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, DRIVE)
    model.actuator_gainprm[drive, 0] = 1.0
    model.actuator_biasprm[drive] = 0.0
    # Servo and friction act on different joints only where there is play.
    axis = model.jnt_dofadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, JOINT)]
    load = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, LOAD_JOINT)
    moved = axis if load < 0 else model.jnt_dofadr[load]
    data.qpos[:] = start.position_m
    data.qvel[:] = start.velocity_mps
    acting = _acting(plant.delay_s, plant.period_s, steps)
    extra = _extra(plant, time, reference, plant.period_s / steps)
    added = _laws(plant, "voltage", plant.period_s)
    pulses = sum((p.size * p.on(time) for p in plant.voltage_pulses), np.zeros(len(time)))
    lag = plant.velocity_lag_s / plant.period_s
    voltages, velocities = _history(start, acting.shape[1], lag)
    kp, kv, limit = plant.kp_per_s, plant.kv_Vs_per_m, plant.limit_V
    positions, given = np.full(len(time), np.nan), np.full(len(time), np.nan)
    low = int(np.floor(lag))
    share = lag - low
    for k in range(len(time)):
        x, v = float(data.qpos[axis]), float(data.qvel[axis])
        if not abs(x) < 10.0:  # NaN, too
            break
        velocities.append(v)
        seen = (1.0 - share) * velocities[-1 - low] + share * velocities[-2 - low] if lag else v
        volts = kv * (kp * (float(reference[k]) - x) - seen) + pulses[k]
        if added:
            volts += added(_State(float(time[k]), x, v, float(data.qacc[axis]), float(reference[k])))
        volts = min(max(volts, -limit), limit)
        voltages.append(volts)
        positions[k], given[k] = x, volts
        recent = voltages[-acting.shape[1] :]
        for weights in acting:
            data.ctrl[drive] = float(np.dot(weights, recent)) if len(recent) > 1 else volts
            if extra is not None:
                own = (float(state[moved]) for state in (data.qpos, data.qvel, data.qacc))
                data.qfrc_applied[moved] = extra(k, *own)
            mujoco.mj_step(model, data)
    return positions, given


def _acting(delay_s: float, period_s: float, steps: int) -> Array:
    """Weights of the last voltages (the newest last) in every step of a period, shape (steps, M): held, and late."""
    step, older = period_s / steps, int(np.ceil(delay_s / period_s - 1e-9))
    out = np.zeros((steps, older + 1))
    for j in range(steps):
        first, last = j * step - delay_s, (j + 1) * step - delay_s
        for m in range(older + 1):  # the voltage of m periods ago holds over [-m, 1 - m] periods
            inside = min(last, (1 - m) * period_s) - max(first, -m * period_s)
            out[j, older - m] = max(inside, 0.0) / step
    return out


def _history(start: Start, voltages: int, lag: float) -> tuple[list[float], list[float]]:
    """What the loop remembers, long enough; older than the start's is as old as it gets."""
    need = max(voltages, int(np.ceil(lag)) + 2)

    def reaching_back(values: Array, otherwise: float) -> list[float]:
        oldest = values[0] if len(values) else otherwise
        return [float(v) for v in [*[oldest] * max(need - len(values), 0), *values]]

    return reaching_back(start.voltages, 0.0), reaching_back(start.velocities_mps, start.velocity_mps)


@dataclass(frozen=True)
class _State:
    """What laws at the axis are functions of.

    Attributes:
        time: on the clock of the reference [s].
        position, velocity, acceleration: of the carriage.
        reference: that is asked for [m].
    """

    time: float
    position: float
    velocity: float
    acceleration: float
    reference: float

    @property
    def direction(self) -> float:
        """Of motion, in [-1, 1]."""
        return min(max(self.velocity / STRIBECK_MPS, -1.0), 1.0)

    @property
    def error(self) -> float:
        """Reference minus position [m]."""
        return self.reference - self.position


def _laws(plant: Plant, target: str, period_s: float) -> Callable[[_State], float] | None:
    """What laws add to a target at every step of a period; None where there are none."""
    running = [law.running(period_s) for law in plant.laws if law.target == target]
    if not running:
        return None
    return lambda state: sum(value(lambda name: float(getattr(state, name))) for value in running)


def _extra(plant: Plant, time: Array, reference: Array, step_s: float):
    """Force that MJCF lacks, from sample, position, velocity and acceleration; None where there is none.

    To be asked once a step: laws may remember what was.
    """
    laws = _laws(plant, "force", step_s)
    if not (plant.ripples or plant.stribeck_N or plant.force_pulses or plant.pushes or laws):
        return None
    given = np.zeros(len(time))
    for train in plant.force_pulses:
        given -= train.size * train.on(time)
    for push in plant.pushes:
        given += push.force_N * ((time >= push.start_s) & (time < push.start_s + push.duration_s))

    def force(k: int, x: float, v: float, a: float) -> float:
        total = given[k]
        for ripple in plant.ripples:
            angle = 2.0 * np.pi * x / ripple.wavelength_m
            total -= ripple.cosine_N * np.cos(angle) + ripple.sine_N * np.sin(angle)
        if plant.stribeck_N:
            direction = min(max(v / STRIBECK_MPS, -1.0), 1.0)
            total -= plant.stribeck_N * direction * np.exp(-abs(v) / plant.stribeck_mps)
        if laws is not None:
            total -= laws(_State(float(time[k]), x, v, a, float(reference[k])))
        return float(total)

    return force
