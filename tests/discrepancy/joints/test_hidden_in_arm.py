"""What the arm's campaign hides in its model, held against MuJoCo's statics."""

import mujoco
import numpy as np
import pytest

from joints import arm as machine
from joints.arm import CAUSE_OF, Form

SIZES = {"yielding": 1e-4, "rotor": 0.05}


def hidden(*forms):
    """The owner's model with forms (name, joint) in it, and its degrees of freedom: motors', then what bends."""
    spec = machine.model_spec()
    for name, joint in forms:
        Form(name, CAUSE_OF[name], joint, SIZES[name], 0).change(spec)
    model = spec.compile()
    bends = [model.joint(j).name.startswith(machine.BEND) for j in range(model.njnt)]
    return model, np.flatnonzero(~np.array(bends)), np.flatnonzero(bends)


@pytest.mark.parametrize("joint", [1, 2, 4, 7])
def test_a_joint_that_bends_does_so_by_compliance_times_load(joint):
    """At rest: bent so far, nothing is asked of the bend, and of the motors what the rigid arm asks there."""
    model, motors, bends = hidden(("yielding", joint))
    rigid = machine.model_spec().compile()
    data, stiff = mujoco.MjData(model), mujoco.MjData(rigid)
    stiff.qpos[:] = machine.CENTRE
    for _ in range(20):
        mujoco.mj_inverse(rigid, stiff)
        bend = -SIZES["yielding"] * stiff.qfrc_inverse[joint - 1]
        stiff.qpos[joint - 1] = machine.CENTRE[joint - 1] + bend
    data.qpos[motors], data.qpos[bends] = machine.CENTRE, bend
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(data.qfrc_inverse[bends], 0.0, atol=1e-9)
    np.testing.assert_allclose(data.qfrc_inverse[motors], stiff.qfrc_inverse, atol=1e-9)
    assert abs(bend) > 1e-5 or joint in (1, 7), "upright axes carry nothing"


@pytest.mark.parametrize("forms", [(("yielding", 2), ("rotor", 5)), (("rotor", 5), ("yielding", 2))])
def test_one_form_does_not_move_another(forms):
    """A bend is a joint more: a rotor behind it stays at its own."""
    model, motors, bends = hidden(*forms)
    expected = machine.ROTOR_KGM2 + SIZES["rotor"] * np.eye(7)[4]
    np.testing.assert_allclose(model.dof_armature[motors], expected)
    np.testing.assert_array_equal(model.dof_armature[bends], 0.0)
