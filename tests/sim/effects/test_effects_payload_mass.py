"""A mass that is put on the payload, taken off, or leaks out."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from effect_cases import example, one_robot
from estimator.errors import InputError
from mocobot_sim.effects import make_effect
from mocobot_sim.trial.trajectories import SETTLE_S, random_vias
from mocobot_sim.trial.trial import run_trial

PAYLOAD = '<geom type="box" size="0.3 0.2 0.05" pos="0.2 0.1 -0.1" euler="10 20 30" mass="5"/>'
ON_TOP = '<geom type="box" size="0.1 0.08 0.06" pos="0.3 -0.1 0.12" euler="40 0 -25" mass="{}"/>'
BOX = '<mujoco><worldbody><body name="payload"><freejoint/>{}</body></worldbody></mujoco>'


def body(*geoms):
    return mujoco.MjModel.from_xml_string(BOX.format("".join(geoms)))


def inertia(model, k=1):
    R = Rotation.from_quat(model.body_iquat[k], scalar_first=True).as_matrix()
    return R @ np.diag(model.body_inertia[k]) @ R.T


def on(model, duration_s=10.0):
    index = SimpleNamespace(payload_body=1)
    return SimpleNamespace(
        model=model, data=None, index=index, rate_hz=1000, duration=round(1000 * duration_s)
    )


def effect_of(mass, **size):
    """The box on top, of MuJoCo's own inertia."""
    alone = body(ON_TOP.format(mass))
    rows, columns = np.triu_indices(3)
    names = [f"inertia_{'xyz'[i]}{'xyz'[j]}_m2" for i, j in zip(rows, columns, strict=True)]
    own = dict(zip(names, (inertia(alone)[rows, columns] / mass).tolist(), strict=True))
    at = dict(zip(("point_x_m", "point_y_m", "point_z_m"), alone.body_ipos[1].tolist(), strict=True))
    return make_effect("payload_mass", size | own | at)


def test_a_box_on_top_is_what_mujoco_makes_of_both():
    both, model = body(PAYLOAD, ON_TOP.format(0.7)), body(PAYLOAD)
    effect_of(0.7, mass_kg=0.7).load(model, on(model).index, 1)
    assert model.body_mass[1] == pytest.approx(both.body_mass[1])
    np.testing.assert_allclose(model.body_ipos[1], both.body_ipos[1], atol=1e-12)
    np.testing.assert_allclose(inertia(model), inertia(both), atol=1e-10)
    # And it moves like it.
    motion = []
    for one in (model, both):
        data = mujoco.MjData(one)
        data.qvel[:] = [0.3, -0.2, 0.1, 1.0, -2.0, 1.5]
        mujoco.mj_step(one, data, nstep=200)
        motion.append(data.qpos.copy())
    np.testing.assert_allclose(motion[0], motion[1], atol=1e-9)


def test_what_leaks_out_in_a_trial_is_gone_by_then():
    left, model = body(PAYLOAD, ON_TOP.format(0.4)), body(PAYLOAD, ON_TOP.format(0.7))
    (actor,) = effect_of(0.7, rate_kgps=-0.1).actors(None)
    actor.start(on(model, 4.0))
    for tick in range(3001):
        actor.act(tick)
    assert model.body_mass[1] == pytest.approx(left.body_mass[1])
    np.testing.assert_allclose(model.body_ipos[1], left.body_ipos[1], atol=1e-12)
    np.testing.assert_allclose(inertia(model), inertia(left), atol=1e-10)


def test_it_is_there_in_its_trials_only():
    effect = example("payload_mass", trial=2, last_trial=3)
    assert [len(effect.actors(number)) for number in (1, 2, 3, 4)] == [0, 1, 1, 0]
    assert [len(example("payload_mass", trial=3).actors(number)) for number in (2, 3, 9)] == [0, 1, 1]


def test_a_robot_moves_as_with_a_box_that_is_welded_on(tmp_path):
    """In a trial, against MuJoCo's own body on the payload; without either it moves otherwise."""
    at = {"point_x_m": 0.1, "point_y_m": 0.05, "point_z_m": 0.1}
    plain, changed, welded = (
        one_robot(tmp_path, *hidden)
        for hidden in ((), (make_effect("payload_mass", {"mass_kg": 0.5, "trial": 2} | at),), ())
    )
    payload = welded.root.find("body", "omnid1/payload/payload")
    box = payload.add("body", name="box", pos=list(at.values()))
    box.add("inertial", pos=[0.0, 0.0, 0.0], mass=0.5, diaginertia=[1e-9] * 3)
    motion = random_vias(plain.wrist_home_b, np.random.default_rng(0), 1, box_m=(0.03, 0.03, 0.03))
    start = round(100 * SETTLE_S)
    phi = [run_trial(scene, motion, trial_number=2).phi[start:] for scene in (plain, changed, welded)]
    assert np.abs(phi[0] - phi[2]).max() > 3e-3
    assert np.abs(phi[1] - phi[2]).max() < 1e-5
    np.testing.assert_array_equal(run_trial(changed, motion, trial_number=1).phi[start:], phi[0])


def test_no_more_is_taken_off_than_there_is():
    sentence, stage = (
        "payload_mass: the payload of 5 kg would weigh -[0-9.]+ kg; it must weigh something",
        on(body(PAYLOAD)),
    )
    with pytest.raises(InputError, match=sentence):
        make_effect("payload_mass", {"mass_kg": -5.5}).load(stage.model, stage.index, 1)
    (leak,) = make_effect("payload_mass", {"rate_kgps": -0.6}).actors(1)
    with pytest.raises(InputError, match=sentence):
        leak.start(stage)
