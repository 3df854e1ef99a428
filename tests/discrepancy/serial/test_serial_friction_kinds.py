"""Friction that fades while a joint runs warm, its shape, and a second kind beside friction of another shape."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.shape.reshape import reshaped
from discrepancy.least_squares.problem import Problem
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.forms import forms_beside
from discrepancy.serial.rig import SerialRig
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import step
from serial_made import a_little_off, nominal, simulated, spec

WHEEL = """
<mujoco><option timestep="1e-3" gravity="0 0 0" integrator="implicitfast"/><worldbody><body>
  <inertial mass="1" pos="0 0 0" diaginertia="0.02 0.02 0.02"/><joint name="wheel" axis="0 0 1"/>
</body></worldbody></mujoco>"""
FADES = {"more_Nm": 0.3, "exponent": 0.0, "over_s": 0.5, "typical_per_s": 2.0, "until_s": 2.0}


def fading(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
    """The elbow's friction, of which a third is gone in the end; it changes sides within 5 mrad/s."""
    out = np.zeros_like(q)
    out[2] = 0.4 * np.tanh(v[2] / 0.005) + (0.6 + 0.3 * np.exp(-time / 6.0)) * v[2]
    return out


def test_friction_that_fades_is_found(tmp_path: Path) -> None:
    hidden = a_little_off(spec(), np.random.default_rng(110)).compile()
    found = diagnose_serial(
        nominal(tmp_path), [simulated(hidden, 10, fading)], laws="never", closed_loop=False
    )
    causes = {f.candidate.cause: f for f in found.diagnosis.causes}
    assert set(causes) == {"friction", "warming"}
    assert {f.candidate.joint for f in causes.values()} == {3}
    shape = causes["warming"].candidate.shape
    assert shape["exponent"] == 1.0
    # More at the begin than in the end, of the viscous friction, whatever the time constant is taken to be.
    gone = (
        causes["warming"].values[0] / shape["typical_per_s"] * -np.expm1(-shape["until_s"] / shape["over_s"])
    )
    assert gone == pytest.approx(0.3 * -np.expm1(-shape["until_s"] / 6.0), rel=0.2)
    # Friction is the mean over the log.
    mean = 0.6 + 0.3 * 6.0 / shape["until_s"] * -np.expm1(-shape["until_s"] / 6.0)
    assert causes["friction"].values == pytest.approx([0.4, mean], abs=0.02)
    assert "friction is" in str(found)


def test_friction_of_the_stepper_fades() -> None:
    """In closed form: a wheel slows down by friction whose integral over time is known."""
    model = mujoco.MjModel.from_xml_string(WHEEL)
    model.dof_solref[:], model.dof_solimp[:] = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
    model.dof_frictionloss[:] = 0.2
    data, effect = mujoco.MjData(model), RobotEffect("warming", 1, None, FADES)
    data.qvel[0] = 20.0
    over, until = FADES["over_s"], FADES["until_s"]
    for _ in range(1000):
        step(model, data, [effect], np.zeros(1))
    left = over * -np.expm1(-data.time / over) - data.time * over / until * -np.expm1(-until / over)
    assert data.qvel[0] == pytest.approx(20.0 - (0.2 * data.time + FADES["more_Nm"] * left) / 0.02, abs=0.02)


def test_a_shape_is_told_from_the_noise_that_is_left(tmp_path: Path) -> None:
    """Friction that stops within 5 mrad/s, taken for one that gives way by 4 mrad."""

    def rubs(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
        out = np.zeros_like(q)
        out[2] = 0.4 * np.tanh(v[2] / 0.005)
        return out

    rig = SerialRig.of(nominal(tmp_path), [simulated(spec().compile(), 12, rubs, seconds=12.0)])
    candidates = rig.candidates()
    (index,) = (k for k, c in enumerate(candidates) if (c.cause, c.joint) == ("friction", 3))
    soft = next(s for s in CAUSES["friction"].shapes(rig.hints, 2) if s.get("bristle_rad") == 4e-3)
    candidates[index] = replace(candidates[index], shape=dict(soft))
    problem = Problem.of(rig.rows(candidates), candidates)
    nothing, wrong = Hypothesis.of(problem, ()), Hypothesis.of(problem, (index,))
    found = reshaped(rig, wrong, nothing)
    assert "bristle_rad" not in found.causes[0].shape
    assert found.score > wrong.score + 5.0
    assert found.fit.part(index)[0][0] == pytest.approx(0.4, abs=0.02)


def test_what_another_shape_explains_is_no_second_kind(tmp_path: Path) -> None:
    """Friction that gives way, taken for rigid: what makes up for that is within its shapes, and no credit."""
    rig = SerialRig.of(nominal(tmp_path), [simulated(spec().compile(), 11, seconds=12.0)])
    tree, names = rig.tree, rig.model.joints
    rigid, soft = (
        CAUSES["friction"].at(tree, names, 2, shape)
        for shape in (CAUSES["friction"].shapes(rig.hints, 2)[k] for k in (0, 5))
    )
    assert "bristle_rad" in soft.shape
    (stribeck,) = (c for c in rig.candidates() if c.cause == "stribeck" and c.joint == 3)
    there = [(rigid, np.array([0.4, 0.1]))]
    beside = forms_beside(rig, stribeck, np.array([-0.1]), there)
    for t, forms in enumerate(beside):
        change = 0.4 * (rig.columns(soft)[t] - rig.columns(rigid)[t])[..., 0].ravel()
        basis = forms.reshape(-1, forms.shape[2])
        left = change - basis @ np.linalg.lstsq(basis, change, rcond=None)[0]
        assert np.sum(left**2) < 1e-9 * np.sum(change**2)
    # Not of its own, and not at another joint.
    assert not forms_beside(rig, soft, np.array([0.4, 0.1]), there)
    (elsewhere,) = (c for c in rig.candidates() if c.cause == "stribeck" and c.joint == 2)
    assert not forms_beside(rig, elsewhere, np.array([-0.1]), there)


def test_friction_and_an_offset_are_held_against_each_other_beside_the_same(tmp_path: Path) -> None:
    """An offset is charged for what friction at its joint leaves, friction is not: neither is where the two compare."""
    rig = SerialRig.of(nominal(tmp_path), [simulated(spec().compile(), 11, seconds=12.0)])
    each = {c.cause: c for c in rig.candidates() if c.joint == 3}
    offset, one_way, spring = each["torque_offset"], each["asymmetric_coulomb"], each["counterbalance"]
    there = [(each["friction"], np.array([0.4, 0.1]))]
    assert not rig.charged_alike(offset, one_way)
    assert rig.charged_alike(offset, spring)
    assert forms_beside(rig, offset, np.array([0.1]), there)
    assert not forms_beside(rig, offset, np.array([0.1]), there, one_way)
    assert not forms_beside(rig, one_way, np.array([0.1]), there, offset)
    besides = [*there, (spring, np.array([0.2, 0.1]))]
    some, all_ = (forms_beside(rig, offset, np.array([0.1]), besides, other) for other in (one_way, None))
    alone = forms_beside(rig, offset, np.array([0.1]), [(spring, np.array([0.2, 0.1]))])
    for own, more, by_itself in zip(some, all_, alone, strict=True):
        assert 0 < own.shape[2] < more.shape[2]
        np.testing.assert_array_equal(own, by_itself)
