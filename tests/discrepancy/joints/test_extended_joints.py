"""Findings in an extended model: each cause as it is measured, hidden by MuJoCo or by hand-written torques.

A cause is fitted with the engine's own columns, which says what its numbers and signs mean; the model that is made of
these numbers must then need the torques of the truth.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.evidence.findings import Event, Finding, Member
from discrepancy.joints.diagnosed import write_extended
from discrepancy.joints.effects import absolute, effects_of, physical
from discrepancy.joints.mechanics import Tree, inverse_torque
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.problem import Given, JointProblem, joint_problem
from discrepancy.joints.rolled import LoggedTorques, Robot
from discrepancy.joints.signals import Signals
from estimator.errors import InputError
from mocobot_logs.joints.joint_log import Drive, JointLog
from mocobot_sim.serial.effects import ActingLaw, JointLaw
from mocobot_sim.serial.extended import load_effects, step
from mocobot_sim.serial.extended import write_extended as write_laws

ARM = """<mujoco><compiler angle="radian"/><option timestep="1e-5" integrator="implicitfast"/><worldbody>
<body name="one" pos="0 0 0.3"><joint name="turn" axis="0 0 1" armature="0.02" frictionloss="0.6" damping="0.4"/>
  <inertial pos="0.02 0.01 0.1" mass="3" diaginertia="0.03 0.03 0.02"/>
<body name="two" pos="0 0 0.2"><joint name="shoulder" axis="0 1 0" armature="0.5" frictionloss="0.6" damping="0.4"/>
  <inertial pos="0.15 0 0.02" mass="2.5" diaginertia="0.02 0.04 0.04"/>
<body name="three" pos="0.35 0 0"><joint name="elbow" axis="0 1 0" frictionloss="0.6" damping="0.4"/>
  <inertial pos="0.12 0.01 0" mass="1.2" diaginertia="0.008 0.012 0.012"/>
<body name="four" pos="0.2 0 0"><joint name="rail" type="slide" axis="1 0 0" frictionloss="3" damping="4"/>
  <inertial pos="0.05 0 0.02" mass="0.8" diaginertia="0.003 0.004 0.004"/>
<body name="hand" pos="0.1 0 0"><inertial pos="0.03 0 0.01" mass="0.5" diaginertia="0.002 0.002 0.002"/>
</body></body></body></body></body></worldbody></mujoco>"""
RATE_HZ, SECONDS = 250.0, 16.0
NAMES = ("turn", "shoulder", "elbow", "rail")
Change = Callable[[mujoco.MjSpec], None]
Truth = Callable[["Motion"], np.ndarray]
"""Torque at one joint, shape (W,), or at all of them, (W, J)."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions and their derivatives, shape (W, J); torques of the given model without friction; time."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    rigid: np.ndarray
    asked: np.ndarray
    t: np.ndarray


def inverse(model: mujoco.MjModel, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """By MuJoCo, without what rubs."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
    data, out = mujoco.MjData(model), np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse
    return out


def joint_log(q: np.ndarray, torque: np.ndarray, names: tuple[str, ...] = NAMES) -> JointLog:
    J = len(names)
    none = np.full(J, np.nan)
    drive = Drive(np.ones(J), np.eye(J), np.ones(J), np.zeros(J, dtype=bool), "none", none, none, "torque",
                  np.full(J, np.inf))  # fmt: skip
    return JointLog(
        "log", np.arange(len(q)) / RATE_HZ, RATE_HZ, q, torque, None, None, names, drive, np.zeros(J),
        np.ones(len(q), dtype=bool), RATE_HZ,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """The arm in a motion, and what the engine makes of it."""

    model: SerialModel
    motion: Motion
    linear: JointProblem
    moving: np.ndarray


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    model = load_model(path)
    rng = np.random.default_rng(1)
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    w = 2.0 * np.pi * rng.uniform(0.1, 0.9, (5, 4))
    size, phase = rng.uniform(0.5, 1.0, (5, 4)) / w * [1.2, 1.2, 1.2, 0.3], rng.uniform(0.0, 6.0, (5, 4))
    angle = w * t[:, None, None] + phase
    q, v, a = ((size * x).sum(axis=1) for x in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    rigid = inverse(mujoco.MjModel.from_xml_string(ARM), q, v, a)
    own = model.model
    asked = rigid + own.dof_frictionloss * np.sign(v) + own.dof_damping * v
    log = replace(joint_log(q, asked), enabled=np.ones(len(t), dtype=bool))
    smooth = Signals.of(log, Tree.of(model.model), partial(inverse_torque, model.model))
    linear = joint_problem(model, [smooth], given=Given(back_emf=frozenset(range(4))))
    moving = (np.abs(v) > [0.1, 0.1, 0.1, 0.03]).all(axis=1)
    moving[: round(0.3 * RATE_HZ)] = moving[-round(0.3 * RATE_HZ) :] = False
    return Case(model, Motion(q, v, a, rigid, asked, t), linear, moving)


def fitted(
    case: Case, group: tuple[str, str], shape: dict[str, float], more: np.ndarray, **also: int
) -> Finding:
    """A finding by the engine's columns, for torques (W, J) that are measured beyond the given model's."""
    (chosen,) = (g for g in case.linear.groups if g.key == group and dict(g.shape) == shape)
    edge = (len(more) - len(case.linear.joints[0][0].t)) // 2
    here = case.moving[edge : len(more) - edge]
    columns = np.zeros((len(here), 4, len(chosen.columns)))
    for k, c in enumerate(chosen.columns):
        for j, series in case.linear.series[c].items():
            columns[:, j, k] = series[0]
    A, y = columns[here].reshape(-1, columns.shape[2]), more[edge : len(more) - edge][here].ravel()
    size = np.linalg.norm(A, axis=0)
    x = np.linalg.lstsq(A / size, y, rcond=1e-9)[0] / size
    values, _ = physical(case.linear, chosen, x, np.eye(len(x)))
    return finding(*group, values, absolute(case.linear, chosen), **also)


def needed(case: Case, folder: Path, torque: np.ndarray) -> np.ndarray:
    """What the extended robot lacks of the torques that the motion takes, at every 20th sample that moves."""
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    effects, m = load_effects(folder), case.motion
    inertia, out = np.zeros((4, 4)), []
    for k in np.flatnonzero(case.moving)[::20]:
        data = mujoco.MjData(model)
        data.time, data.qpos[:], data.qvel[:], data.qacc[:] = m.t[k], m.q[k], m.v[k], m.a[k]
        step(model, data, effects, torque[k])
        mujoco.mj_fullM(model, data, inertia)
        out.append(inertia @ ((data.qvel - m.v[k]) / model.opt.timestep - m.a[k]))
    return np.array(out)


def finding(cause: str, place: str, values: dict[str, float], shape: dict[str, float] | None = None,
            **more: Any) -> Finding:  # fmt: skip
    joint = NAMES.index(place) + 1 if place in NAMES else None
    member = Member(place, joint, values, dict.fromkeys(values, 0.01))
    return Finding(cause, place, joint, (member,), 0.99, 50.0, 0.0, 0.0, shape=shape or {}, **more)


def verdict(case: Case, *findings: Finding) -> SimpleNamespace:
    return SimpleNamespace(model=case.model, findings=findings, trials=("log",), reference=())


def at(joint: str, torque: Truth) -> Truth:
    """A torque at one joint."""
    return lambda m: torque(m)[:, None] * (np.array(NAMES) == joint)


def typical(case: Case, joint: str) -> tuple[float, float, float]:
    """Speed, middle and longest time of a joint, as shares are of."""
    span = case.linear.joints[NAMES.index(joint)][0].span
    return span.speed, span.middle, span.until_s


E, R = NAMES.index("elbow"), NAMES.index("rail")
SHARE = 0.1
TORQUES: dict[str, tuple[str, str, dict[str, float], Truth]] = {
    "friction": ("friction", "elbow", {},
                 lambda m: 0.4 * np.sign(m.v[:, E]) + 0.2 * m.v[:, E]),
    "friction of a slide": ("friction", "rail", {},
                            lambda m: 2.0 * np.sign(m.v[:, R]) + 3.0 * m.v[:, R]),
    "less friction": ("friction", "elbow", {},
                      lambda m: -0.4 * np.sign(m.v[:, E]) - 0.3 * m.v[:, E]),
    "rotor": ("armature", "elbow", {}, lambda m: 0.05 * m.a[:, E]),
    "rotor of a slide": ("armature", "rail", {}, lambda m: 0.7 * m.a[:, R]),
    "by direction": ("asymmetric_coulomb", "elbow", {}, lambda m: np.full(len(m.t), 0.3)),
    "by direction and speed": ("asymmetric_viscous", "elbow", {},
                               lambda m: 0.3 * np.abs(m.v[:, E])),
    "by load": ("load_friction", "elbow", {}, lambda m: 0.15 * np.abs(m.rigid[:, E]) * np.sign(m.v[:, E])),
    "by load, without the rotor": (
        "load_friction", "shoulder", {},
        lambda m: 0.15 * np.abs(m.rigid[:, 1] - 0.5 * m.a[:, 1]) * np.sign(m.v[:, 1]),
    ),
    "counterbalance": ("counterbalance", "elbow", {},
                       lambda m: 1.2 * np.cos(m.q[:, E] - 0.6)),
    "ripple": ("ripple", "elbow", {"turns": 3.0}, lambda m: 0.4 * np.cos(3 * m.q[:, E] + 1)),
    "ripple of a slide": ("ripple", "rail", {"turns": 4.0},
                          lambda m: 2.0 * np.sin(4.0 * m.q[:, R])),
}  # fmt: skip


@pytest.mark.parametrize("name", TORQUES)
def test_a_torque_at_a_joint(name: str, case: Case, tmp_path: Path) -> None:
    cause, joint, shape, truth = TORQUES[name]
    hidden = at(joint, truth)(case.motion)
    found = fitted(case, (cause, joint), shape, hidden)
    agrees(case, found, case.motion.asked + hidden, hidden, tmp_path)


def agrees(
    case: Case, found: Finding, torque: np.ndarray, hidden: np.ndarray, folder: Path, most: float = 0.02
) -> None:
    """The extended model needs the torques of the truth; without the finding it would not."""
    write_extended(verdict(case, found), folder / "extended")  # type: ignore[arg-type]
    left = needed(case, folder / "extended", torque)
    size = np.sqrt(np.mean(hidden[case.moving] ** 2))
    assert np.sqrt(np.mean(left**2)) < most * size


@pytest.mark.parametrize("joint", ["elbow", "rail"])
def test_friction_at_low_speed(joint: str, case: Case, tmp_path: Path) -> None:
    speed, _, _ = typical(case, joint)
    v = case.motion.v[:, NAMES.index(joint)]
    hidden = at(joint, lambda m: 0.5 * np.sign(v) * np.exp(-np.abs(v) / (0.2 * speed)))(case.motion)
    found = fitted(case, ("stribeck", joint), {"share": 0.2}, hidden)
    assert found.members[0].values["excess_N" if joint == "rail" else "excess_Nm"] == pytest.approx(
        0.5, rel=0.02
    )
    agrees(case, found, case.motion.asked + hidden, hidden, tmp_path)


@pytest.mark.parametrize("bend", [0.4, -0.4])
def test_friction_that_bends(bend: float, case: Case, tmp_path: Path) -> None:
    """With the viscous friction of the model it stays above zero, though it is below the model's Coulomb friction."""
    speed, _, _ = typical(case, "elbow")
    v = case.motion.v[:, E]
    hidden = at("elbow", lambda m: bend * np.sign(v) * np.log(1.0 + np.abs(v) / (0.3 * speed)))(case.motion)
    found = fitted(case, ("sublinear_friction", "elbow"), {"share": 0.3}, hidden)
    agrees(case, found, case.motion.asked + hidden, hidden, tmp_path)


@pytest.mark.parametrize("joint", ["elbow", "rail"])
def test_friction_that_fades(joint: str, case: Case, tmp_path: Path) -> None:
    _, _, until = typical(case, joint)
    v = case.motion.v[:, NAMES.index(joint)]
    hidden = at(joint, lambda m: (0.5 * np.sign(v) + 0.3 * v) * np.exp(-m.t / (0.3 * until)))(case.motion)
    found = fitted(case, ("warming", joint), {"share": 0.3}, hidden)
    agrees(case, found, case.motion.asked + hidden, hidden, tmp_path)


def both_joints(case: Case, ratio: float) -> np.ndarray:
    u, du = (x[:, E] + ratio * x[:, E - 1] for x in (case.motion.v, case.motion.a))
    torque = 0.4 * np.sign(u) + 0.2 * u + 0.05 * du
    hidden = np.zeros_like(case.motion.q)
    hidden[:, E], hidden[:, E - 1] = torque, ratio * torque
    return hidden


@pytest.mark.parametrize("ratio", [1.0, -1.0])
def test_a_motor_of_two_joints(ratio: float, case: Case, tmp_path: Path) -> None:
    hidden = both_joints(case, ratio)
    slow = np.abs(case.motion.v[:, E] + ratio * case.motion.v[:, E - 1]) < 0.2
    here = Case(case.model, case.motion, case.linear, case.moving & ~slow)
    found = fitted(here, ("coupled_drive", "elbow"), {"ratio": ratio}, hidden, partner=E)
    np.testing.assert_allclose(list(found.members[0].values.values()), [0.4, 0.2, 0.05], rtol=0.02)
    agrees(here, found, case.motion.asked + hidden, hidden, tmp_path)


def truth_of(case: Case, change: Change) -> tuple[np.ndarray, np.ndarray]:
    """Torques of an arm that MuJoCo's attributes make another, and what they are beyond the given model's."""
    spec = mujoco.MjSpec.from_string(ARM)
    change(spec)
    m = case.motion
    hidden = inverse(spec.compile(), m.q, m.v, m.a) - m.rigid
    return m.asked + hidden, hidden


def spring(spec: mujoco.MjSpec) -> None:
    spec.joint("elbow").stiffness, spec.joint("elbow").springref = [2.0, 0.0, 0.0], 0.3


def pushing_spring(spec: mujoco.MjSpec) -> None:
    spec.joint("rail").stiffness, spec.joint("rail").springref = [40.0, 0.0, 0.0], -0.2


@pytest.mark.parametrize("change", [spring, pushing_spring])
def test_a_spring(change: Change, case: Case, tmp_path: Path) -> None:
    joint = "elbow" if change is spring else "rail"
    torque, hidden = truth_of(case, change)
    agrees(case, fitted(case, ("spring", joint), {}, hidden), torque, hidden, tmp_path)


def test_a_spring_that_pushes_away(case: Case, tmp_path: Path) -> None:
    hidden = at("elbow", lambda m: -1.0 * (m.q[:, E] - 0.2))(case.motion)
    found = fitted(case, ("spring", "elbow"), {}, hidden)
    assert found.members[0].values["stiffness_Nm_per_rad"] == pytest.approx(-1.0, rel=0.01)
    agrees(case, found, case.motion.asked + hidden, hidden, tmp_path)


def heavier(spec: mujoco.MjSpec) -> None:
    spec.body("three").mass *= 1.25  # its inertia about its centre stays


def heavier_hand(spec: mujoco.MjSpec) -> None:
    spec.body("hand").mass *= 1.5


def other_centre(spec: mujoco.MjSpec) -> None:
    spec.body("three").ipos = [0.13, 0.005, 0.01]


def other_centre_of_hand(spec: mujoco.MjSpec) -> None:
    spec.body("hand").ipos = [0.04, 0.01, 0.0]


def more_inertia(spec: mujoco.MjSpec) -> None:
    spec.body("two").inertia = 1.4 * np.array([0.02, 0.04, 0.04])


def longer(spec: mujoco.MjSpec) -> None:
    spec.body("three").pos = [0.355, 0.003, -0.004]


def off_zero(spec: mujoco.MjSpec) -> None:
    spec.joint("elbow").ref = -0.02  # reads 0.02 rad less than it stands, in the pose of the drawing


def off_zero_of_slide(spec: mujoco.MjSpec) -> None:
    spec.joint("rail").ref = 0.004


def tilted(spec: mujoco.MjSpec) -> None:
    spec.option.gravity = Rotation.from_rotvec([0.02, -0.03, 0.0]).inv().apply([0.0, 0.0, -9.81])


def floating(spec: mujoco.MjSpec) -> None:
    for body in spec.bodies[1:]:
        body.gravcomp = 0.3


def load(spec: mujoco.MjSpec, place: str = "three") -> None:
    box = spec.body(place).add_body()
    box.mass, box.explicitinertial, box.pos = 1.5, True, [0.05, 0.02, 0.03]
    box.ipos, box.inertia = [0.0, 0.0, 0.0], [8e-3, 9e-3, 6e-3]


ATTRIBUTES: dict[str, tuple[Change, str, str]] = {
    "mass": (heavier, "link_mass", "three"),
    "mass behind the last joint": (heavier_hand, "link_mass", "hand"),
    "centre": (other_centre, "link_com", "three"),
    "centre behind the last joint": (other_centre_of_hand, "link_com", "hand"),
    "inertia": (more_inertia, "link_inertia", "two"),
    "length": (longer, "link_length", "elbow"),
    "zero": (off_zero, "joint_zero", "elbow"),
    "zero of a slide": (off_zero_of_slide, "joint_zero", "rail"),
    "tilt": (tilted, "gravity_direction", "base"),
    "gravity compensation": (floating, "gravity_compensation", "robot"),
}


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_an_attribute_of_mujoco(name: str, case: Case, tmp_path: Path) -> None:
    change, cause, place = ATTRIBUTES[name]
    torque, hidden = truth_of(case, change)
    found = fitted(case, (cause, place), {}, hidden)
    linear = cause in ("link_mass", "link_inertia", "gravity_compensation")
    agrees(case, found, torque, hidden, tmp_path, most=1e-3 if linear else 0.05)


PAYLOAD = (
    "mass_kg",
    "x_m",
    "y_m",
    "z_m",
    *(f"inertia_{axes}_kgm2" for axes in ("xx", "yy", "zz", "xy", "xz", "yz")),
)


def about_centre(x: np.ndarray) -> dict[str, float]:
    """Mass, centre and inertia about it of mass, first and second moments."""
    m, c = x[0], x[1:4] / x[0]
    xx, yy, zz, xy, xz, yz = x[4:]
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - m * (c @ c * np.eye(3) - np.outer(c, c))
    return dict(
        zip(PAYLOAD, map(float, [m, *c, *np.diag(own), own[0, 1], own[0, 2], own[1, 2]]), strict=True)
    )


def test_a_payload_behind_the_last_joint(case: Case, tmp_path: Path) -> None:
    torque, hidden = truth_of(case, lambda spec: load(spec, "hand"))
    found = fitted(case, ("payload", "hand"), {}, hidden)
    assert found.members[0].values["mass_kg"] == pytest.approx(1.5, rel=0.01)
    agrees(case, found, torque, hidden, tmp_path)


def test_a_tool_that_the_robot_has_not(case: Case, tmp_path: Path) -> None:
    """The mass of a payload may be negative between two days; the link keeps the rest."""

    def lighter(spec: mujoco.MjSpec) -> None:
        spec.body("three").mass, spec.body("three").ipos = 0.9, [0.11, 0.0, 0.0]
        spec.body("three").inertia = [0.006, 0.010, 0.010]

    torque, hidden = truth_of(case, lighter)
    m, c = np.array([1.2, -0.9]), np.array([[0.12, 0.01, 0.0], [0.11, 0.0, 0.0]])
    inertia = [np.diag([0.008, 0.012, 0.012]), -np.diag([0.006, 0.010, 0.010])]
    about = sum(i + w * (x @ x * np.eye(3) - np.outer(x, x)) for i, w, x in zip(inertia, m, c, strict=True))
    moments = [*np.diag(about), about[0, 1], about[0, 2], about[1, 2]]
    gone = about_centre(-np.array([m.sum(), *(m @ c), *moments]))
    assert gone["mass_kg"] == pytest.approx(-0.3)
    agrees(case, finding("payload", "three", gone), torque, hidden, tmp_path, most=1e-3)


READINGS: dict[str, tuple[str, Truth]] = {
    "offset": ("torque_offset", lambda m: m.asked[:, E] + 0.7),
    "scale": ("torque_scale", lambda m: 1.08 * m.asked[:, E]),
    "back-EMF": ("back_emf", lambda m: m.asked[:, E] + 0.3 * m.v[:, E]),
    "delay": ("torque_delay", lambda m: np.interp(m.t - 0.004, m.t, m.asked[:, E])),
}


@pytest.mark.parametrize("name", READINGS)
def test_a_reading_of_a_torque(name: str, case: Case) -> None:
    """The drive gives what it gave before the reading was spoilt."""
    cause, truth = READINGS[name]
    told = case.motion.asked.copy()
    told[:, E] = truth(case.motion)
    shape = {"bend": 0.0} if cause == "torque_scale" else {}
    found = fitted(case, (cause, "elbow"), shape, told - case.motion.asked)
    real = given_by(case, found, told)
    left = (real - case.motion.asked)[case.moving]
    assert np.sqrt(np.mean(left**2)) < 0.03 * np.sqrt(np.mean((told - case.motion.asked)[case.moving] ** 2))


def given_by(case: Case, found: Finding, told: np.ndarray) -> np.ndarray:
    """Torques that drives give by a log of them."""
    robot = Robot.of(case.model, [found], RATE_HZ)
    torques = LoggedTorques.of(joint_log(case.motion.q, told), robot.readings)
    m = case.motion
    return np.array([torques(t, q, v) for t, q, v in zip(m.t, m.q, m.v, strict=True)])


def test_a_reading_that_saturates(case: Case) -> None:
    load = np.abs(case.motion.asked[:, E])
    told = case.motion.asked.copy()
    size = float(np.sqrt(np.mean(case.linear.joints[E][0].asked ** 2)))
    told[:, E] *= 1.0 + 0.2 * (1.0 - 0.1 * (load / size - 1.0))
    found = fitted(case, ("torque_scale", "elbow"), {"bend": -0.1}, told - case.motion.asked)
    np.testing.assert_allclose(
        given_by(case, found, told)[case.moving], case.motion.asked[case.moving], atol=0.01
    )


def test_a_kind_is_one_effect_a_member(case: Case) -> None:
    members = tuple(
        Member(n, k + 1, {"offset_Nm": 0.1 * k}, {"offset_Nm": 0.01}) for k, n in enumerate(NAMES)
    )
    kind = Finding("torque_offset", "all joints", None, members, 0.99, 50.0, 0.0, 0.0)
    assert [(e.joint, e.number("offset")) for e in effects_of(kind, case.model)] == [
        (k + 1, pytest.approx(0.1 * k)) for k in range(4)
    ]


def test_a_link_that_is_named_as_the_joint_of_another(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    inertial = '<inertial pos="0 0 0.1" mass="{}" diaginertia="0.01 0.01 0.01"/>'
    path.write_text(
        f'<mujoco><worldbody><body name="a"><joint name="b"/>{inertial.format(1)}<body name="b"><joint name="a"/>'
        f"{inertial.format(2)}</body></body></worldbody></mujoco>"
    )
    heavy = Finding("link_mass", "b", 1, (Member("b", 1, {"excess_kg": 0.5}, {}),), 0.99, 50.0, 0.0, 0.0)
    made = SimpleNamespace(model=load_model(path), findings=(heavy,), trials=("log",), reference=())
    write_extended(made, tmp_path / "extended")  # type: ignore[arg-type]
    extended = mujoco.MjModel.from_xml_path(str(tmp_path / "extended" / "robot.xml"))
    assert (extended.body("a").mass[0], extended.body("b").mass[0]) == (1.0, 2.5)


def test_gravity_is_compensated_with_the_payload_in_it(case: Case, tmp_path: Path) -> None:
    def change(spec: mujoco.MjSpec) -> None:
        load(spec)
        for body in spec.bodies[1:]:
            body.gravcomp = 0.3

    torque, hidden = truth_of(case, change)
    values = dict.fromkeys(PAYLOAD, 0.0) | {"mass_kg": 1.5, "x_m": 0.05, "y_m": 0.02, "z_m": 0.03}
    values |= {"inertia_xx_kgm2": 8e-3, "inertia_yy_kgm2": 9e-3, "inertia_zz_kgm2": 6e-3}
    both = (finding("gravity_compensation", "robot", {"share": 0.3}), finding("payload", "three", values))
    write_extended(verdict(case, *both), tmp_path / "extended")  # type: ignore[arg-type]
    assert np.abs(needed(case, tmp_path / "extended", torque)).max() < 0.02 * np.abs(hidden).max()


def test_what_is_not_simulated_is_said(case: Case, tmp_path: Path) -> None:
    push = finding("push", "four", {"x_N": 5.0, "y_N": 0.0, "z_N": 0.0}, event=Event(0, 3.0, 0.5))
    found = [
        push,
        finding("elasticity", "elbow", {"compliance_rad_per_Nm": 1e-3}),
        Finding("unlisted", "turn", 1, (), 0.9, 50.0, 0.0, 0.1),
    ]
    write_extended(verdict(case, *found), tmp_path / "extended")  # type: ignore[arg-type]
    file = json.loads((tmp_path / "extended" / "effects.json").read_text())
    assert file["version"] == 3
    assert [(c["cause"], c["in"]) for c in file["causes"]] == [
        ("push", "none"), ("elasticity", "none"), ("unlisted", "none")
    ]  # fmt: skip
    assert file["causes"][0]["parameters"]["start_s"] == 3.0
    assert load_effects(tmp_path / "extended") == []


def test_a_law_is_written_and_stepped(tmp_path: Path) -> None:
    """What nobody has listed: 0.5 N m of the elbow's dry friction are gone after some time constants of 8 s."""
    law = JointLaw("torque_3", "warming", "time", -0.5, 8.0, times="direction_3")
    wobble = JointLaw("position_2", "sine", "q_2", 0.004, 3.0)
    write_laws(mujoco.MjSpec.from_string(ARM), [law, wobble], tmp_path / "extended", ["log"])
    (acting,) = load_effects(tmp_path / "extended")  # a reading that is off is not simulated
    assert isinstance(acting, ActingLaw)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "extended" / "robot.xml"))
    data = mujoco.MjData(model)
    data.time, data.qvel[E] = 16.0, 0.5
    step(model, data, [acting], np.zeros(4))
    np.testing.assert_allclose(data.qfrc_applied, [0.0, 0.0, 0.5 * (1.0 - np.exp(-2.0)), 0.0], atol=1e-9)


def test_a_folder_of_an_earlier_release_is_refused(tmp_path: Path) -> None:
    old = {"format": "mocobot-extended-robot", "version": 2, "causes": [], "recordings": []}
    (tmp_path / "effects.json").write_text(json.dumps(old))
    with pytest.raises(InputError, match=r"effects\.json: version is 2; it must be 3: diagnose again"):
        load_effects(tmp_path)
