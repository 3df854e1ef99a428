"""What a pendulum with a damper does to the payload that it hangs in, held against MuJoCo's."""

import mujoco
import numpy as np
import pytest

from discrepancy.team.causes.slosh import _swing

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
    shape = {"length_m": length_m, "damping_ratio": damping_ratio}
    # Along x it swings about -y.
    swing, damped = _swing(drive, -turned, 1.0 / STEP_S, GRAVITY, shape)
    expected = -MASS_KG * (accel + swing[:, 0]), -MASS_KG * damped[:, 0]
    for found, said in zip((force_x, moment_y), expected, strict=True):
        assert np.abs(found).max() > 1e-3
        assert np.sqrt(np.mean((found - said) ** 2)) < 0.02 * np.sqrt(np.mean(found**2))
