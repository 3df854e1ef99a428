"""What the engine makes of logs of an arm in MuJoCo: silence, and hidden effects by name, place and size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.evidence.probability import odds_of
from discrepancy.evidence.search import Chosen
from discrepancy.joints import causes, problem
from discrepancy.joints.diagnose import Outcome, diagnose, labels_of
from discrepancy.joints.trials import trials_of
from followed_arm import arm_log, arm_model, both, rubs


def names(outcome: Outcome) -> set[tuple[str, str]]:
    return outcome.state.keys


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("arm")


def test_silence_on_the_arm_as_its_model_says(folder: Path) -> None:
    named = rubs(0.5, 0.3)
    assert names(diagnose(arm_model(folder, named), [arm_log(named, 1)])) == set()


def test_a_model_without_friction_is_one_finding(folder: Path) -> None:
    """Two logs; a rotor is hidden beside the friction of all joints."""

    def rotor(spec: mujoco.MjSpec) -> None:
        spec.joint("elbow").armature = 0.08

    true = both(rubs(0.5, 0.3), rotor)
    found = diagnose(arm_model(folder), [arm_log(true, 2), arm_log(true, 3)])
    assert names(found) == {("friction", "all joints"), ("armature", "elbow")}
    numbers = labels_of(found)
    for joint in ("turn", "shoulder", "elbow"):
        for label, true_value in ((f"{joint} coulomb_Nm", 0.5), (f"{joint} viscous_Nms_per_rad", 0.3)):
            value, se = numbers[label]
            assert abs(value - true_value) < 4.0 * se
            assert se < 0.1
    value, se = numbers["elbow armature_kgm2"]
    assert abs(value - 0.08) < 4.0 * se
    (friction, _) = odds_of(found.search, found.state)
    assert friction.probability > 0.99
    again = found.search.value(found.state.chosen, found.state.posterior)
    assert again.evidence == pytest.approx(found.state.evidence, abs=0.5)  # its noise is learnt to the end


def test_one_bad_joint_stays_one_bad_joint(folder: Path) -> None:
    named = rubs(0.5, 0.3)
    found = diagnose(arm_model(folder, named), [arm_log(both(named, rubs(0.9, 0.3, "shoulder")), 4)])
    assert names(found) == {("friction", "shoulder")}
    value, se = labels_of(found)["shoulder coulomb_Nm"]
    assert value == pytest.approx(0.4, abs=4.0 * se)


def test_a_load_at_the_last_link(folder: Path) -> None:
    named = rubs(0.5, 0.3)

    def load(spec: mujoco.MjSpec) -> None:
        box = spec.body("three").add_body()
        box.mass, box.explicitinertial, box.pos = 1.5, True, [0.25, 0.0, 0.03]
        box.ipos, box.inertia = [0.0, 0.0, 0.0], [4e-4, 5e-4, 6e-4]

    found = diagnose(arm_model(folder, named), [arm_log(both(named, load), 5)])
    assert names(found) == {("payload", "three")}
    value, se = labels_of(found)["payload three mx"]
    assert value == pytest.approx(1.5 * 0.25, abs=4.0 * se)


def test_friction_at_rest_is_that_of_all_terms_together(folder: Path) -> None:
    """Coulomb friction of 2 N m, less 1.5 N m of Stribeck friction: what is left at rest is 0.5 N m."""
    model = arm_model(folder)
    linear = problem.joint_problem(model, trials_of(model, [arm_log(rubs(0.5), 9)]).runs)

    def rests(**amounts: float) -> np.ndarray:
        values, chosen = np.zeros(linear.cells.count), []
        for cause, amount in amounts.items():
            group = next(g for g in linear.groups if g.key == (cause, "elbow"))
            values[group.columns[0]] = amount
            chosen.append(Chosen(group, 1.0))
        columns, _ = linear.resting[linear.model.joints.index("elbow")]
        return linear.prior(chosen, values)[columns]

    np.testing.assert_allclose(rests(friction=2.0, stribeck=-1.5), rests(friction=0.5))
    np.testing.assert_allclose(rests(friction=2.0, sublinear_friction=-1.5), rests(friction=2.0))
    load = linear.joints[linear.model.joints.index("elbow")][0].span.torque
    np.testing.assert_allclose(rests(load_friction=0.2), rests(friction=0.2 * load))


def test_a_push_has_its_instant(folder: Path) -> None:
    named = rubs(0.5, 0.3)
    model = arm_model(folder, named)
    log = arm_log(named, 7)
    data, jacobian = mujoco.MjData(model.model), np.zeros((3, 3))
    torque = log.torque.copy()
    for k in np.flatnonzero((log.time > 10.0) & (log.time < 10.8)):
        data.qpos[:] = log.q[k]
        mujoco.mj_fwdPosition(model.model, data)
        mujoco.mj_jacBodyCom(model.model, data, jacobian, None, model.model.body("three").id)
        torque[k] -= jacobian.T @ [0.0, 3.0, 5.0] * np.sin(np.pi * (log.time[k] - 10.0) / 0.8)
    found = diagnose(model, [replace(log, torque=torque)])
    (chosen,) = found.state.chosen
    shape = dict(chosen.group.shape)
    assert chosen.group.cause == "push"
    assert shape["start_s"] + 0.5 * shape["duration_s"] == pytest.approx(10.4, abs=0.4)


def test_a_new_cause_is_one_entry(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's quadratic damping, which no entry of the table describes."""
    named = rubs(0.5, 0.3)

    def drag(spec: mujoco.MjSpec) -> None:
        spec.joint("shoulder").damping = [0.3, 0.4, 0.0]

    log, model = arm_log(both(named, drag), 8), arm_model(folder, named)
    entry = causes.JointCause(
        "quadratic_drag", "drag with the square of the speed in {joint}", ("drag_Nms2_per_rad2",),
        lambda s, h: (s.v * np.abs(s.v),), lambda z, h: (z.torque / z.speed**2,),
    )  # fmt: skip
    assert ("quadratic_drag", "shoulder") not in names(diagnose(model, [log]))
    monkeypatch.setattr(problem, "CAUSES", (*causes.CAUSES, entry))
    found = diagnose(model, [log])
    assert names(found) == {("quadratic_drag", "shoulder")}
    value, se = labels_of(found)["shoulder drag_Nms2_per_rad2"]
    assert value == pytest.approx(0.4, abs=4.0 * se)
