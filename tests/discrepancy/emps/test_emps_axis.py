"""The axis in MuJoCo and its loop, against closed forms and an independent integrator."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.candidate import Candidate, Parameter
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.closed_loop import plant_of
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG
from emps_made import GAIN, KP, KV, nominal
from estimator.errors import InputError
from mocobot_sim.emps.effects import CHANGES
from mocobot_sim.emps.extended import load_plant, write_extended
from mocobot_sim.emps.loop import Start, run
from mocobot_sim.emps.mjcf import DRIVE, JOINT, axis_spec
from mocobot_sim.emps.plant import ForcePush, Plant, PulseTrain, Ripple
from mocobot_sim.scene.models import models_dir

SPEED = 0.1
RUBBING = replace(nominal(), mass_kg=95.0, coulomb_N=(18.0, 22.0), viscous_Ns_per_m=(160.0, 240.0))


def ramp(speed: float, count: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    time = 1e-3 * np.arange(count)
    return time, 0.1 + speed * time


def steady(plant: Plant, speed: float = SPEED, count: int = 1500) -> tuple[float, float]:
    """Tracking error [m] and voltage [V] at constant speed."""
    time, q = ramp(speed, count)
    x, volts = run(plant, time, q, Start(q[0] - speed / KP, speed, np.full(9, speed), np.zeros(9)))
    return float((q - x)[-100:].mean()), float(volts[-100:].mean())


def test_nominal_model_is_what_the_plant_says() -> None:
    ours = axis_spec(nominal()).compile()
    shipped = mujoco.MjModel.from_xml_path(str(models_dir() / "emps" / "emps.xml"))
    for name in ("body_mass", "dof_damping", "dof_frictionloss", "actuator_gainprm", "actuator_biasprm",
                 "actuator_gear", "actuator_forcerange"):  # fmt: skip
        np.testing.assert_allclose(getattr(ours, name), getattr(shipped, name), rtol=1e-6)
    assert ours.opt.timestep == shipped.opt.timestep == 1e-3
    assert shipped.body("carriage").mass[0] == FIRST_GUESS_KG


@pytest.mark.parametrize("q_ref", [0.1001, 0.2, -3.0])
def test_servo_is_the_law_with_its_saturation(q_ref: float) -> None:
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "emps" / "emps.xml"))
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0], data.ctrl[0] = 0.1, 0.02, q_ref
    mujoco.mj_forward(model, data)
    law = np.clip(KV * (KP * (q_ref - 0.1) - 0.02), -10.0, 10.0)
    assert data.sensor("voltage").data[0] == pytest.approx(law, rel=1e-6)
    assert data.qfrc_actuator[0] == pytest.approx(GAIN * law, rel=1e-6)


@pytest.mark.parametrize("speed", [SPEED, -SPEED, 0.02, -0.02])
def test_steady_motion_takes_the_voltage_of_its_friction(speed: float) -> None:
    """V = F / gain and V = kv (kp e - v), whatever the integrator does."""
    error, volts = steady(RUBBING, speed)
    k = 0 if speed > 0 else 1
    force = np.sign(speed) * (RUBBING.coulomb_N[k] + RUBBING.viscous_Ns_per_m[k] * abs(speed))
    assert volts == pytest.approx(force / GAIN, rel=1e-4)
    assert error == pytest.approx((volts / KV + speed) / KP, rel=1e-5)


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
def test_what_mjcf_lacks_takes_its_voltage_too(speed: float) -> None:
    plant = replace(
        nominal(), coulomb_N=(10.0, 10.0), resisting_N=4.0, stribeck_N=6.0, stribeck_mps=0.05,
        pushes=(ForcePush(0.0, 9.0, 1.5),), force_pulses=(PulseTrain(0.0, 10.0, 5.0, 2.5),),
    )  # fmt: skip
    _, volts = steady(plant, speed)
    dry = np.sign(speed) * (10.0 + 6.0 * np.exp(-abs(speed) / 0.05))
    assert volts == pytest.approx((dry + 4.0 - 1.5 + 2.5) / GAIN, rel=1e-4)


def test_injected_voltage_adds_to_the_law() -> None:
    time, q = ramp(SPEED)
    train = PulseTrain(0.2, 0.5, 0.2, 0.7)
    start = Start(q[0] - SPEED / KP, SPEED, np.full(9, SPEED), np.zeros(9))
    x, volts = run(replace(nominal(), voltage_pulses=(train,)), time, q, start)
    on = train.on(time)
    v = np.gradient(x, 1e-3)
    inside = np.r_[150:190, 260:390, 460:690]  # away from edges, where v is smooth
    law = KV * (KP * (q - x) - v)
    np.testing.assert_allclose((volts - law)[inside], 0.7 * on[inside], atol=2e-3)


def continuous(plant: Plant, time: np.ndarray, q) -> np.ndarray:
    """Position by an independent integrator: held voltage, delayed, with the velocity's lag; no dry friction."""
    period, lag = plant.period_s, plant.velocity_lag_s
    x, state, volts, seen = [], np.array([q(0.0), 0.0]), [0.0, 0.0], [0.0] * 4
    for t in time:
        x.append(state[0])
        seen.append(state[1])
        back = lag / period
        low = int(back)
        v = (1 - back + low) * seen[-1 - low] + (back - low) * seen[-2 - low]
        law = plant.kv_Vs_per_m * (plant.kp_per_s * (q(t) - state[0]) - v)
        volts.append(float(np.clip(law, -plant.limit_V, plant.limit_V)))
        old, new = volts[-2], volts[-1]

        def slope(s, y, t=t, old=old, new=new):
            u = old if s < t + plant.delay_s else new
            ripple = sum(
                r.cosine_N * np.cos(2 * np.pi * y[0] / r.wavelength_m)
                + r.sine_N * np.sin(2 * np.pi * y[0] / r.wavelength_m)
                for r in plant.ripples
            )
            force = plant.gain_N_per_V * u - plant.viscous_Ns_per_m[0] * y[1] - ripple
            return [y[1], force / plant.mass_kg]

        knot = t + min(plant.delay_s, period)
        for a, b in ((t, knot), (knot, t + period)):
            if b > a:
                state = solve_ivp(slope, (a, b), state, rtol=1e-8, atol=1e-12, max_step=period).y[:, -1]
    return np.array(x)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"velocity_lag_s": 1.3e-3},
        {"delay_s": 5e-4},
        {"viscous_Ns_per_m": (200.0, 200.0), "ripples": (Ripple(2.5e-3, 3.0, -5.0),)},
    ],
    ids=["plain", "lag", "delay", "ripple"],
)
def test_loop_agrees_with_another_integrator(changes: dict) -> None:
    plant = replace(nominal(), **changes)
    time = 1e-3 * np.arange(500)

    def q(t: float) -> float:
        return 0.02 * (1.0 - np.cos(2.0 * np.pi * t / 0.5))

    reference = np.array([q(t) for t in time])
    x, _ = run(plant, time, reference, Start(0.0, 0.0, np.zeros(4), np.zeros(4)))
    expected = continuous(plant, time, q)
    bare = continuous(nominal(), time, q) if changes else 0.0
    tolerance = 2e-8 if not changes else 0.02 * np.abs(expected - bare).max()
    assert np.abs(x - expected).max() < max(tolerance, 2e-8)


def test_a_delay_of_whole_periods_shifts_the_voltage() -> None:
    """Held voltages act one period later, no matter how the steps divide it."""
    time, q = ramp(SPEED, 300)
    start = Start(q[0] - SPEED / KP, SPEED, np.full(9, SPEED), np.zeros(9))
    for delay in (1e-3, 2e-3):
        plant = replace(nominal(), delay_s=delay)
        x, volts = run(plant, time, q, start)
        acted = np.concatenate([np.zeros(round(delay / 1e-3)), volts])[: len(volts)]
        v = SPEED + np.concatenate([[0.0], np.cumsum(acted)]) * GAIN / plant.mass_kg * 1e-3
        np.testing.assert_allclose(np.diff(x) / 1e-3, 0.5 * (v[:-2] + v[1:-1]), atol=1e-9)


def test_play_lets_the_motor_run_free() -> None:
    """Standing at one side of the play, a gentle reversal moves the motor across it before the carriage follows."""
    plant = replace(nominal(), coulomb_N=(20.0, 20.0), play_m=1e-3)
    model = axis_spec(plant).compile()
    data = mujoco.MjData(model)
    assert model.nq == 2
    assert sum(model.body_mass) == pytest.approx(FIRST_GUESS_KG)
    motor, load = (model.joint(n).qposadr[0] for n in (JOINT, "load"))
    data.ctrl[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, DRIVE)] = 0.02
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.qpos[motor] == pytest.approx(0.02, abs=1e-4)
    assert abs(data.qpos[motor] - data.qpos[load]) <= 0.52e-3


@pytest.mark.parametrize("plant", [nominal(), RUBBING], ids=["nominal", "rubbing"])
def test_plain_mujoco_needs_no_help(plant: Plant, tmp_path: Path) -> None:
    """The written MJCF, stepped by MuJoCo alone with the reference as control, takes the voltage of its friction."""
    write_extended(plant, [], tmp_path / "axis", ["here"])
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "axis" / "axis.xml"))
    data = mujoco.MjData(model)
    _, q = ramp(-SPEED)
    data.qpos[0], data.qvel[0] = q[0] + SPEED / KP, -SPEED
    for value in q:
        data.ctrl[0] = value
        x = float(data.qpos[0])
        mujoco.mj_step(model, data)
    force = -(plant.coulomb_N[1] + plant.viscous_Ns_per_m[1] * SPEED)
    volts = data.sensor("voltage").data[0]
    assert volts == pytest.approx(force / GAIN, rel=1e-3, abs=1e-4)
    assert q[-1] - x == pytest.approx((volts / KV - SPEED) / KP, rel=1e-3)


def test_extended_axis_is_read_back(tmp_path: Path) -> None:
    plant = replace(
        RUBBING, ripples=(Ripple(1e-3, 1.0, 2.0),), voltage_pulses=(PulseTrain(0.1, 1.0, 0.5, 5.0),),
        force_pulses=(PulseTrain(-0.1, 1.0, 0.5, 5.0),), pushes=(ForcePush(1.0, 2.0, 3.0),), play_m=1e-5, delay_s=1e-4,
    )  # fmt: skip
    write_extended(plant, [], tmp_path / "axis", ["here"])
    assert load_plant(tmp_path / "axis") == plant
    path = tmp_path / "axis" / "plant.json"
    path.write_text(path.read_text().replace('"mass_kg"', '"weight"'))
    with pytest.raises(InputError, match=r"plant\.json"):
        load_plant(tmp_path / "axis")
    with pytest.raises(InputError, match=r"plant\.json"):
        load_plant(tmp_path)


def test_every_cause_changes_the_plant() -> None:
    """No cause is forgotten in the simulation, and each number of the plant belongs to one; laws are beside them."""
    hints = Hints(2.5e-3, *[{"start_s": 0.1, "period_s": 1.0, "width_s": 0.5}] * 2, 0.0, 0.0)
    touched = set()
    for name, cause in CAUSES.items():
        shape = {"start_s": 0.1, "duration_s": 0.4} if name == "push" else dict(cause.shapes(hints)[-1])
        parameters = tuple(Parameter(p, 0.0, 1.0) for p in cause.parameters)
        candidate = Candidate(name, cause.family, None, None, parameters, shape)
        changed = plant_of(nominal(), [(candidate, np.full(len(parameters), 1e-3))])
        different = {f.name for f in fields(Plant) if getattr(changed, f.name) != getattr(nominal(), f.name)}
        assert different, name
        touched |= different
    assert set(CHANGES) == {*CAUSES, "law"}
    assert {f.name for f in fields(Plant)} - touched == {"gain_N_per_V", "period_s", "limit_V", "laws"}


def test_a_run_that_fails_says_so() -> None:
    unstable = replace(nominal(), velocity_lag_s=0.05, kv_Vs_per_m=5e4, limit_V=1e9)
    x, _ = run(unstable, *ramp(SPEED, 2000), Start(0.1, 0.0, np.zeros(80), np.zeros(80)))
    assert np.isnan(x[-1])
