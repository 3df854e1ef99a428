"""What a verdict names where MuJoCo, or a torque written by hand, has one thing that the model has not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.joints.model import SerialModel
from discrepancy.joints.verdict import JointVerdict, judged
from followed_arm import ARM, Change, Torque, arm_log, arm_model, both, rubs
from mocobot_logs.joints.joint_log import JointLog

NAMED = rubs(0.5, 0.3)
"""Friction that the model names, and the robot has."""
TURN, SHOULDER, ELBOW = np.eye(3)
Read = Callable[[JointLog], JointLog]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return arm_model(tmp_path_factory.mktemp("arm"), NAMED)


def what(verdict: JointVerdict) -> set[tuple[str, str]]:
    return {(f.cause, f.place) for f in verdict.findings}


def values_of(verdict: JointVerdict) -> tuple[dict[str, float], dict[str, float]]:
    """Of the only finding at its only place."""
    ((member,),) = (f.members for f in verdict.findings)
    return dict(member.values), dict(member.errors)


def checked(verdict: JointVerdict, cause: str, place: str, **true: float) -> None:
    """One finding, of the true values within four standard errors; nothing is left."""
    assert what(verdict) == {(cause, place)}
    assert verdict.verdict == "explained"
    assert verdict.findings[0].probability > 0.5
    assert verdict.findings[0].nothing < 0.01
    values, errors = values_of(verdict)
    for name, x in true.items():
        assert abs(values[name] - x) < 4.0 * errors[name], name


# --- MuJoCo's own attributes


def rotor(spec: mujoco.MjSpec) -> None:
    spec.joint("elbow").armature = 0.08


def spring(spec: mujoco.MjSpec) -> None:
    joint = spec.joint("shoulder")
    joint.stiffness, joint.springref = [3.0, 0.0, 0.0], 0.4


def of_steel(spec: mujoco.MjSpec) -> None:
    link = spec.body("two")
    link.mass *= 2.2
    link.inertia = np.asarray(link.inertia) * 2.2


def long_link(spec: mujoco.MjSpec) -> None:
    spec.body("three").pos = [0.375, 0.0, 0.015]


def hollow(spec: mujoco.MjSpec) -> None:
    link = spec.body("two")
    link.inertia = np.asarray(link.inertia) * 6.0


def tilted(spec: mujoco.MjSpec) -> None:
    spec.option.gravity = Rotation.from_rotvec([-0.06, 0.0, 0.0]).apply([0.0, 0.0, -9.81])


ATTRIBUTES: dict[str, tuple[Change, str, str, dict[str, float]]] = {
    "rotor": (rotor, "armature", "elbow", {"armature_kgm2": 0.08}),
    "spring": (spring, "spring", "shoulder", {"stiffness_Nm_per_rad": 3.0}),
    "link of steel": (of_steel, "link_mass", "two", {"excess_kg": 3.0}),
    "long link": (long_link, "link_length", "elbow", {"x_m": 0.025, "z_m": 0.015}),
    "hollow": (hollow, "link_inertia", "two", {"share": 5.0}),
    "tilted": (tilted, "gravity_direction", "base", {"tilt_1_rad": 0.06, "tilt_2_rad": 0.0}),
}


@pytest.mark.parametrize("case", ATTRIBUTES)
def test_an_attribute_of_mujoco(model: SerialModel, case: str) -> None:
    change, cause, place, true = ATTRIBUTES[case]
    checked(judged(model, [arm_log(both(NAMED, change), 11)]), cause, place, **true)


# --- MuJoCo's dry friction, of a size that changes


def fading(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    return ELBOW * 0.6 * np.exp(-time / 6.0)


def near_standstill(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    return SHOULDER * 0.8 * np.exp(-np.abs(v) / 0.08)


def grease(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    """The root of the speed, which no entry of the table is."""
    return ELBOW * 0.8 * np.sqrt(np.abs(v))


def loaded_gear() -> Torque:
    """By what the shoulder carries, by MuJoCo's inverse dynamics of the motion until now."""
    free = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(free)

    def level(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
        data.qacc[:] = (v - data.qvel) / free.opt.timestep if time else 0.0
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_inverse(free, data)
        return SHOULDER * 0.12 * np.abs(data.qfrc_inverse)

    return level


DRY: dict[str, tuple[Torque, str, str, dict[str, float]]] = {
    "fading": (fading, "warming", "elbow", {}),
    "near standstill": (near_standstill, "stribeck", "shoulder", {}),
    "grease": (grease, "sublinear_friction", "elbow", {}),
    "loaded gear": (loaded_gear(), "load_friction", "shoulder", {"share": 0.12}),
}


@pytest.mark.parametrize("case", DRY)
def test_dry_friction_that_changes(model: SerialModel, case: str) -> None:
    level, cause, place, true = DRY[case]
    checked(judged(model, [arm_log(NAMED, 12, dry=level)]), cause, place, **true)


def test_friction_that_differs_by_direction_or_an_offset(model: SerialModel) -> None:
    """While a joint moves the two are the same torque: the verdict names both."""
    log = arm_log(NAMED, 12, dry=lambda q, v, time: ELBOW * 0.25 * np.sign(v))
    (finding,) = judged(model, [log]).findings
    assert set(finding.told) == {("asymmetric_coulomb", "elbow"), ("torque_offset", "elbow")}


# --- torques written by hand


def thicker_forwards(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    return -ELBOW * 0.3 * np.abs(v)


def balanced(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    return -TURN * 1.5 * np.sin(q - 0.7)


def cogs(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    return -SHOULDER * 0.4 * np.sin(4.0 * q + 0.3)


TORQUES: dict[str, tuple[Torque, str, str, dict[str, float]]] = {
    "thicker forwards": (thicker_forwards, "asymmetric_viscous", "elbow", {"asymmetry_Nms_per_rad": 0.3}),
    "balanced": (balanced, "counterbalance", "turn",
                 {"sine_Nm": 1.5 * np.cos(0.7), "cosine_Nm": -1.5 * np.sin(0.7)}),
    "cogs": (cogs, "ripple", "shoulder", {"sine_Nm": 0.4 * np.cos(0.3), "cosine_Nm": 0.4 * np.sin(0.3)}),
}  # fmt: skip


@pytest.mark.parametrize("case", TORQUES)
def test_a_torque_written_by_hand(model: SerialModel, case: str) -> None:
    torque, cause, place, true = TORQUES[case]
    checked(judged(model, [arm_log(NAMED, 12, torque)]), cause, place, **true)


# --- readings


def offset(log: JointLog) -> JointLog:
    return replace(log, torque=log.torque + 0.4 * ELBOW)


def scaled(log: JointLog) -> JointLog:
    return replace(log, torque=log.torque * (1.0 - 0.15 * SHOULDER))


def saturated(log: JointLog) -> JointLog:
    """A fourth too large at small torques, and less so the larger these are."""
    return replace(log, torque=log.torque + 0.25 * SHOULDER * 12.0 * np.tanh(log.torque / 12.0))


def late(log: JointLog) -> JointLog:
    torque = log.torque.copy()
    torque[:, 1] = np.interp(log.time - 0.012, log.time, torque[:, 1])
    return replace(log, torque=torque)


def turned(log: JointLog) -> JointLog:
    return replace(log, q=log.q - 0.05 * ELBOW)


def compensated(log: JointLog) -> JointLog:
    """A driver that takes nine tenths of gravity's torque off what it tells."""
    statics = mujoco.MjModel.from_xml_string(ARM)
    data, torque = mujoco.MjData(statics), log.torque.copy()
    for k, q in enumerate(log.q):
        data.qpos[:] = q
        mujoco.mj_forward(statics, data)
        torque[k] -= 0.9 * data.qfrc_bias
    return replace(log, torque=torque)


READINGS: dict[str, tuple[Read, str, str, dict[str, float]]] = {
    "offset": (offset, "torque_offset", "elbow", {"offset_Nm": 0.4}),
    "scaled": (scaled, "torque_scale", "shoulder", {"scale": -0.15}),
    "saturated": (saturated, "torque_scale", "shoulder", {}),
    "late": (late, "torque_delay", "shoulder", {"delay_s": 0.012}),
    "turned": (turned, "joint_zero", "elbow", {"zero_rad": 0.05}),
    "compensated": (compensated, "gravity_compensation", "robot", {"share": 0.9}),
}


@pytest.mark.parametrize("case", READINGS)
def test_a_reading_that_is_off(model: SerialModel, case: str) -> None:
    read, cause, place, true = READINGS[case]
    checked(judged(model, [read(arm_log(NAMED, 13))]), cause, place, **true)


def test_a_motor_before_a_spring(tmp_path: Path) -> None:
    """With its encoder, without friction: it stands ahead of its link by torque over stiffness."""
    log = arm_log(lambda spec: None, 14)
    soft = replace(log, q=log.q + SHOULDER * 2e-3 * log.torque)
    verdict = judged(arm_model(tmp_path), [soft])
    checked(verdict, "elasticity", "shoulder", compliance_rad_per_Nm=2e-3)
