"""What a pendulum with a damper does to the payload that it hangs in, held against MuJoCo's."""

import mujoco
import numpy as np
import pytest

from discrepancy.causes.pendulum import Pendulum, swung

MASS_KG, GRAVITY, STEP_S = 0.5, 9.81, 1e-3
HEAVY = 1e6  # of what moves the payload: it goes its way, whatever hangs in it
MODEL = """
<mujoco><option timestep="{step}" gravity="0 0 -{gravity}" integrator="implicitfast"/>
<worldbody><body name="payload">
  <joint name="x" type="slide" axis="1 0 0" armature="{heavy}"/>
  <joint name="turn" type="hinge" axis="0 1 0" armature="{heavy}"/>
  <geom size="0.1" mass="1"/>
  <body name="mass"><joint type="hinge" axis="0 1 0" damping="{damping}"/>
    <inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/></body>
</body></worldbody></mujoco>"""
MOVED = """
<mujoco><option timestep="{step}" gravity="0 0 -{gravity}" integrator="RK4"/>
<worldbody><body name="payload">
  <joint type="slide" axis="1 0 0" armature="{heavy}"/>
  <joint type="slide" axis="0 1 0" armature="{heavy}"/>
  <joint type="slide" axis="0 0 1" armature="{heavy}"/>
  <geom size="0.1" mass="1"/>
  <body name="mass">
    <joint type="hinge" axis="1 0 0" damping="{damping}"/>
    <joint type="hinge" axis="0 1 0" damping="{damping}"/>
    <inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(("length_m", "damping_ratio"), [(0.25, 0.05), (0.1, 0.2)])
def test_a_damper_is_fixed_to_the_payload(length_m, damping_ratio):
    """The payload goes to and fro and turns about the point; MuJoCo says what acts on it there.

    The damper turns with the payload, and its moment is felt.
    """
    w = np.sqrt(GRAVITY / length_m)
    damping = 2.0 * damping_ratio * w * MASS_KG * length_m**2
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(
            step=STEP_S, gravity=GRAVITY, heavy=HEAVY, damping=damping, length=length_m, mass=MASS_KG
        )
    )
    data = mujoco.MjData(model)
    time = STEP_S * np.arange(8000)
    accel = 0.15 * np.sin(4.0 * time) * np.minimum(time, 1.0)
    turn_accel = 0.6 * np.sin(2.5 * time + 0.4) * np.minimum(time, 1.0)
    force_x, moment_y, turned = np.zeros((3, len(time)))
    mass = model.body("mass").id
    for k in range(len(time)):
        data.qfrc_applied[:2] = HEAVY * accel[k], HEAVY * turn_accel[k]
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        # On the mass by the payload, about the centre of mass of all.
        moment, force = data.cfrc_int[mass, :3], data.cfrc_int[mass, 3:]
        lever = data.subtree_com[model.body("payload").id] - data.xpos[mass]
        force_x[k], moment_y[k] = -force[0], -(moment + np.cross(lever, force))[1]
        turned[k] = data.qvel[1]
        mujoco.mj_step(model, data)
    drive = np.stack([accel, *np.zeros((3, len(time)))], axis=1)
    pendulum, none = Pendulum(length_m, damping_ratio, GRAVITY, 1.0 / STEP_S), np.zeros(len(time))
    # Along x it swings about -y.
    (swing, _), (damped, _), _ = swung([drive, 0.0 * drive], [-turned, none], none, [pendulum, pendulum])
    expected = -MASS_KG * (accel + swing[:, 0]), -MASS_KG * damped[:, 0]
    for found, said in zip((force_x, moment_y), expected, strict=True):
        assert np.abs(found).max() > 1e-3
        assert np.sqrt(np.mean((found - said) ** 2)) < 0.02 * np.sqrt(np.mean(found**2))


@pytest.mark.parametrize(
    ("moved_mps2", "allowed", "allowed_upwards"), [(0.1, 0.0015, 0.015), (0.3, 0.01, 0.06)]
)
def test_a_pendulum_swings_as_far_as_it_is_moved(moved_mps2, allowed, allowed_upwards):
    """Its point goes along all axes; swings of 0.03 and 0.09 rad rms are MuJoCo's, what raises the mass included.

    To first order alone they are off by 1 and 4 %, and nothing is raised.
    """
    length_m, damping_ratio = 0.25, 0.05
    damping = 2.0 * damping_ratio * np.sqrt(GRAVITY / length_m) * MASS_KG * length_m**2
    model = mujoco.MjModel.from_xml_string(
        MOVED.format(
            step=STEP_S, gravity=GRAVITY, heavy=HEAVY, damping=damping, length=length_m, mass=MASS_KG
        )
    )
    data, time = mujoco.MjData(model), STEP_S * np.arange(12000)
    rng = np.random.default_rng(1)
    hz, phase = rng.uniform(0.2, 1.3, (3, 6, 1)), rng.uniform(0.0, 2.0 * np.pi, (3, 6, 1))
    accel = 0.5 * np.sin(2.0 * np.pi * hz * time + phase).sum(axis=1) * np.minimum(time, 1.0)
    accel *= moved_mps2 * np.array([[1.0], [1.0], [0.4]])
    force = np.zeros((len(time), 3))
    mass = model.body("mass").id
    for k in range(len(time)):
        data.qfrc_applied[:3] = HEAVY * accel[:, k] + [0.0, 0.0, GRAVITY * (1.0 + MASS_KG)]
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        force[k] = data.cfrc_int[mass, 3:]  # on the mass by the payload
        data.qfrc_applied[:3] += HEAVY * 0.5 * (accel[:, min(k + 1, len(time) - 1)] - accel[:, k])
        mujoco.mj_step(model, data)
    true = (force / MASS_KG - [0.0, 0.0, GRAVITY]).T - accel
    pendulum, none = Pendulum(length_m, damping_ratio, GRAVITY, 1.0 / STEP_S), np.zeros(len(time))
    drives = [accel[0][:, None], accel[1][:, None]]
    (x, y), _, up = swung(drives, [none, none], accel[2], [pendulum, pendulum])
    for said, found, most in (
        (x[:, 0], true[0], allowed),
        (y[:, 0], true[1], allowed),
        (up, true[2], allowed_upwards),
    ):
        assert np.sqrt(np.mean((said - found) ** 2)) < most * np.sqrt(np.mean(found**2))
