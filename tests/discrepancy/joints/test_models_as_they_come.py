"""Models that MuJoCo refuses or reads otherwise, and parts of models; torques against MuJoCo and closed forms."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.joints.mechanics import (
    Motion,
    Tree,
    body_regressor,
    by_acceleration,
    inverse_torque,
    torque_of,
)
from discrepancy.joints.model import SerialModel, load_model
from estimator.errors import InputError

LIMIT = '<limit lower="-3" upper="3" effort="50" velocity="6"/>'


def link(name: str, inertial: str = "", more: str = "") -> str:
    return f'<link name="{name}">{inertial}{more}</link>'


def inertial(mass: float, at: str, moments: str) -> str:
    keys = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), moments.split(), strict=True)
    tensor = " ".join(f'{key}="{value}"' for key, value in keys)
    return f'<inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia {tensor}/></inertial>'


def joint(name: str, parent: str, child: str, at: str, kind: str = "revolute", more: str = "") -> str:
    axis = "" if kind == "fixed" else f'<axis xyz="0 1 0"/>{LIMIT}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/>{axis}{more}</joint>'
    )


BOOM = inertial(2.5, "0.18 0 0.02", "0.006 0.05 0.05 0 0 0")
HAND = inertial(1.2, "0.12 0.01 0", "0.002 0.012 0.012 0 0.0003 0")
DUO = (
    link("base") + link("boom", BOOM) + link("hand", HAND)
    + joint("shoulder", "base", "boom", "0 0 0.5") + joint("elbow", "boom", "hand", "0.35 0 0")
)  # fmt: skip
"""A URDF that MuJoCo reads as it is."""
BOX = '<collision><geometry><box size="0.1 0.12 0.12"/></geometry></collision>'
MESH = '<visual><geometry><mesh filename="package://r/gone.dae"/></geometry></visual>'


def urdf(folder: Path, text: str, name: str = "robot.urdf") -> Path:
    path = folder / name
    path.write_text(f'<robot name="r">{text}</robot>', encoding="utf-8")
    return path


def moves(count: int, seed: int = 0) -> np.ndarray:
    """Positions, velocities and accelerations, shape (3, 20, count)."""
    return np.random.default_rng(seed).standard_normal((3, 20, count))


def same_torques(found: SerialModel, plain: mujoco.MjModel, tolerance: float = 1e-6) -> None:
    """MuJoCo's inverse dynamics of both models, and that of the tree, are the same."""
    motion = moves(plain.nv)
    asked = inverse_torque(plain, *motion)
    np.testing.assert_allclose(inverse_torque(found.model, *motion), asked, atol=tolerance)
    np.testing.assert_allclose(torque_of(Tree.of(found.model), *motion), asked, atol=tolerance)


MASSLESS = {
    "a shape on a fixed link": link("hull", "", BOX) + joint("mount", "hand", "hull", "0.28 0 0", "fixed"),
    "a mesh that is missed": link("hull", "", BOX + MESH) + joint("mount", "hand", "hull", "0.28 0 0", "fixed"),
    "an antenna of the base without inertia": (
        link("antenna", inertial(0.02, "0 0 0", "1e-4 0 0 0 0 0")) + joint("fix", "base", "antenna", "0 0 0", "fixed")
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(MASSLESS))
def test_what_has_no_inertial_or_does_not_move_adds_no_torque(tmp_path, case) -> None:
    plain = mujoco.MjModel.from_xml_path(str(urdf(tmp_path, DUO, "plain.urdf")))
    found = load_model(urdf(tmp_path, DUO + MASSLESS[case]))
    same_torques(found, plain)
    assert found.notes == ()


def test_a_link_without_inertial_that_moves_alone_is_massless(tmp_path) -> None:
    wrist = link("wrist", "", BOX) + joint("roll", "hand", "wrist", "0.28 0 0")
    found = load_model(urdf(tmp_path, DUO + wrist))
    plain = mujoco.MjModel.from_xml_path(str(urdf(tmp_path, DUO, "plain.urdf")))
    q, dq, ddq = moves(3)
    asked = inverse_torque(found.model, q, dq, ddq)
    np.testing.assert_allclose(asked[:, 2], 0.0, atol=1e-8)
    np.testing.assert_allclose(
        asked[:, :2], inverse_torque(plain, q[:, :2], dq[:, :2], ddq[:, :2]), atol=1e-6
    )
    assert "Links that move without an <inertial> are read without mass: wrist." in found.notes


def test_a_frame_that_moves_without_inertia_is_a_point(tmp_path) -> None:
    frame = link("imu", inertial(0.01, "0.1 0 0", "0 0 0 0 0 0")) + joint(
        "fix", "hand", "imu", "0 0 0", "fixed"
    )
    found = load_model(urdf(tmp_path, DUO + frame))
    tiny = frame.replace('ixx="0" iyy="0" izz="0"', 'ixx="1e-10" iyy="1e-10" izz="1e-10"')
    same_torques(found, mujoco.MjModel.from_xml_path(str(urdf(tmp_path, DUO + tiny, "plain.urdf"))))
    assert "Links with a mass and no inertia are read as points: imu." in found.notes


@pytest.mark.parametrize(("axis", "moment"), [("1 0 0", 0.006), ("0 1 0", 0.044), ("0 0 1", 0.0505)])
def test_an_inertia_that_no_body_has_is_computed_with_as_written(tmp_path, axis, moment) -> None:
    """Torque per acceleration about an axis through the joint: moment + m r^2; A + B < C by 1 %."""
    arm = inertial(2.5, "0.18 0 0.02", "0.006 0.044 0.0505 0 0 0")
    text = link("base") + link("boom", arm) + joint("j", "base", "boom", "0 0 0")
    found = load_model(urdf(tmp_path, text.replace("0 1 0", axis)))
    away = {"1 0 0": 0.02**2, "0 1 0": 0.18**2 + 0.02**2, "0 0 1": 0.18**2}[axis]
    q, zero, one = np.array([[0.3]]), np.zeros((1, 1)), np.ones((1, 1))
    gain = inverse_torque(found.model, q, zero, one) - inverse_torque(found.model, q, zero, zero)
    np.testing.assert_allclose(gain, moment + 2.5 * away, rtol=1e-9)
    (note,) = found.notes
    assert note.startswith("Links have an inertia that no body has; torques are computed with it")
    assert note.endswith(": boom (0.006, 0.044, 0.0505 kg m^2).")


def test_the_inertial_frame_of_a_urdf_may_be_turned(tmp_path) -> None:
    """Torque per acceleration of a link whose tensor is given in a frame turned by 0.7 rad about z."""
    arm = inertial(2.0, "0 0 0", "0.01 0.05 0.055 0 0 0").replace("<origin ", '<origin rpy="0 0 0.7" ')
    found = load_model(urdf(tmp_path, link("base") + link("a", arm) + joint("j", "base", "a", "0 0 0")))
    gain = inverse_torque(found.model, *np.array([[[0.3]], [[0.0]], [[1.0]]]))
    np.testing.assert_allclose(gain, 0.01 * np.sin(0.7) ** 2 + 0.05 * np.cos(0.7) ** 2, rtol=1e-9)


def jaw(name: str, side: int, more: str = "") -> str:
    tool = inertial(0.25, f"0 {0.01 * side} 0.03", "2e-5 2e-5 1e-5 0 0 0")
    text = joint(f"{name}_joint", "hand", name, "0.3 0 0", "prismatic", more)
    return link(name, tool) + text.replace("0 1 0", f"0.6 {0.8 * side} 0")


def test_a_joint_that_mimics_another_is_no_joint_of_its_own(tmp_path) -> None:
    """Lagrange: q = E p + e, so the torques of p are E^T (M E ddp + bias); M and bias are MuJoCo's of all joints."""
    mimic = '<mimic joint="left_joint" multiplier="-1.5" offset="0.02"/>'
    last = '<mimic joint="right_joint" multiplier="2"/>'
    free = DUO + jaw("right", -1) + jaw("left", 1) + jaw("third", 1)
    tied = DUO + jaw("right", -1, mimic) + jaw("left", 1) + jaw("third", 1, last)
    full = mujoco.MjModel.from_xml_path(str(urdf(tmp_path, free, "plain.urdf")))
    found = load_model(urdf(tmp_path, tied))
    assert found.joints == ("shoulder", "elbow", "left_joint")
    E, e = np.zeros((5, 3)), np.zeros(5)
    at = {full.joint(j).name: j for j in range(5)}
    for name, row, offset in (
        ("shoulder", [1, 0, 0], 0.0), ("elbow", [0, 1, 0], 0.0), ("left_joint", [0, 0, 1], 0.0),
        ("right_joint", [0, 0, -1.5], 0.02), ("third_joint", [0, 0, -3.0], 0.04),
    ):  # fmt: skip
        E[at[name]], e[at[name]] = row, offset
    data, M, asked = mujoco.MjData(full), np.zeros((5, 5)), []
    p, dp, ddp = moves(3)
    for k in range(len(p)):
        data.qpos[:], data.qvel[:] = E @ p[k] + e, E @ dp[k]
        mujoco.mj_forward(full, data)
        mujoco.mj_fullM(full, data, M)
        asked.append(E.T @ (M @ (E @ ddp[k]) + data.qfrc_bias))
    np.testing.assert_allclose(inverse_torque(found.model, p, dp, ddp), asked, atol=1e-9)
    tree = Tree.of(found.model)
    np.testing.assert_allclose(torque_of(tree, p, dp, ddp), asked, atol=1e-9)
    motion = Motion.of(tree, p, dp, ddp)
    parts = [
        body_regressor(motion, b) @ parameters(tree, b)
        for b in range(1, len(tree.parent))
        if tree.mass[b] > 0
    ]
    np.testing.assert_allclose(np.sum(parts, axis=0), asked, atol=1e-9)
    full.opt.gravity[:] += [0.3, -0.2, 0.1]
    other = load_model(tmp_path / "robot.urdf").model
    other.opt.gravity[:] = full.opt.gravity
    np.testing.assert_allclose(
        inverse_torque(other, p, dp, ddp) - np.array(asked),
        -by_acceleration(motion) @ [0.3, -0.2, 0.1],
        atol=1e-9,
    )
    assert any("right_joint, third_joint" in note for note in found.notes)


def parameters(tree: Tree, b: int) -> np.ndarray:
    m, c = tree.mass[b], tree.com[b]
    about = tree.inertia[b] + m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([m, *(m * c), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])


TORSO = """<mujoco><compiler angle="radian" eulerseq="zyx"/><option gravity="0.5 1 -9.5"/><worldbody>
<geom type="plane" size="1 1 1"/><camera name="cam" mode="targetbody" target="leg"/>
<body name="torso" pos="0 0 1" euler="0.3 0.2 0.1"><freejoint name="root"/>
  <inertial pos="0 0 0.1" mass="9" diaginertia="0.2 0.2 0.1"/>
  <body name="leg" pos="0 0.1 -0.2"><joint name="hip" axis="0 1 0"/><geom name="foot" size="0.05" mass="2"/></body>
  <frame pos="0.1 0 0.3" euler="0.4 0 0.2"><body name="upper" pos="0 -0.2 0" euler="0 0.5 0">
    <inertial pos="0.1 0 0.2" mass="3" fullinertia="0.02 0.03 0.02 0.001 0 0"/>
    <joint name="yaw" axis="0 0 1" pos="0 0 0.05"/><joint name="pitch" axis="0.2 1 0" ref="0.1" pos="0.02 0 0"/>
    <joint name="out" type="slide" axis="1 0 1"/>
    <body name="fore" pos="0.3 0 0" quat="0.9 0.1 0.3 0">
      <inertial pos="0.1 0.02 0" mass="1.5" diaginertia="0.01 0.02 0.02"/>
      <joint name="elbow" axis="0 1 0" range="-2 2"/><site name="wrist" pos="0.2 0 0"/>
      <body name="finger" pos="0.2 0 0"><joint name="grip" type="slide" axis="0 1 0" range="0 0.04"/>
        <geom name="tip" size="0.02" mass="0.1"/></body>
    </body></body></frame></body></worldbody>
<contact><exclude body1="leg" body2="fore"/><pair geom1="foot" geom2="tip"/></contact>
<equality><weld body1="leg" body2="torso" active="false"/></equality>
<tendon><fixed name="both"><joint joint="hip" coef="1"/><joint joint="elbow" coef="1"/></fixed></tendon>
<actuator><motor name="m" joint="elbow"/><motor joint="pitch"/><motor joint="hip"/><motor tendon="both"/></actuator>
<sensor><jointpos joint="hip"/><jointpos joint="pitch"/><tendonpos tendon="both"/><actuatorfrc actuator="m"/></sensor>
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0 0 0"/></keyframe></mujoco>"""
LOCKS = {
    "all others": {"root": 0, "hip": "20deg", "yaw": 0.4, "pitch": -0.3, "out": 0.05, "grip": "0.02 m"},
    "the last of one body": {"root": "0", "hip": 0.1, "out": 0.07, "grip": 0.01, "elbow": "-30deg"},
    "the middle of one body": {"root": 0, "hip": 0.2, "pitch": 0.5, "grip": 0},
}


@pytest.mark.parametrize("case", list(LOCKS))
def test_locked_joints_stay_where_they_are_locked(tmp_path, case) -> None:
    """The torques of the others are MuJoCo's of the whole model, in which the locked joints rest."""
    path, lock = tmp_path / "torso.xml", LOCKS[case]
    path.write_text(TORSO, encoding="utf-8")
    found, whole = load_model(path, lock), mujoco.MjModel.from_xml_path(str(path))
    names = ("hip", "yaw", "pitch", "out", "elbow", "grip")
    assert found.joints == tuple(name for name in names if name not in lock)
    compare(found, whole, {name: rad(value) for name, value in lock.items() if name != "root"})
    assert found.source.copy().compile().nu == sum(
        name in found.joints for name in ("hip", "pitch", "elbow")
    ) + ({"hip", "elbow"} <= set(found.joints))


def rad(value: float | str) -> float:
    text = str(value).removesuffix(" m")
    return np.radians(float(text[:-3])) if text.endswith("deg") else float(text)


def compare(found: SerialModel, whole: mujoco.MjModel, stays: dict[str, float]) -> None:
    whole.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(whole)
    motion = moves(len(found.joints))
    own = [whole.joint(name).dofadr[0] for name in found.joints]
    asked = []
    for q, dq, ddq in zip(*motion, strict=True):
        mujoco.mj_resetData(whole, data)
        for name, value in stays.items():
            data.qpos[whole.joint(name).qposadr[0]] = value
        for k, name in enumerate(found.joints):
            data.qpos[whole.joint(name).qposadr[0]] = q[k]
        data.qvel[own], data.qacc[own] = dq, ddq
        mujoco.mj_inverse(whole, data)
        asked.append(data.qfrc_inverse[own].copy())
    np.testing.assert_allclose(inverse_torque(found.model, *motion), asked, atol=1e-9)
    np.testing.assert_allclose(torque_of(Tree.of(found.model), *motion), asked, atol=1e-9)


@pytest.mark.parametrize(
    ("base", "lock", "joints"),
    [
        ("upper", {}, ("yaw", "pitch", "out", "elbow", "grip")),
        ("fore", {"yaw": 0.7, "pitch": "-40deg", "grip": 0.03}, ("elbow",)),
    ],
)
def test_a_base_stands_still_with_all_above_it(tmp_path, base, lock, joints) -> None:
    path = tmp_path / "torso.xml"
    path.write_text(TORSO, encoding="utf-8")
    found, whole = load_model(path, lock, base), mujoco.MjModel.from_xml_path(str(path))
    assert found.joints == joints
    compare(found, whole, {name: rad(value) for name, value in lock.items()})
    bodies = [found.model.body(b).name for b in range(found.model.nbody)]
    assert bodies == ["world", "torso", "upper", "fore", "finger"]


REFUSED = {
    ("wrist=1",): "lock: unknown joint 'wrist'",
    ("elbow=120deg",): "lock of elbow is '120deg'; its range in the model is -2 to 2 rad",
    ("elbow=x",): "lock of elbow is 'x'; it must be a number in rad, or in degrees such as 30deg",
    ("grip=2deg",): "lock of grip is '2deg'; it must be a number in m$",
    ("root=1",): "lock of root is '1'; it must be 0, which leaves a free or ball joint as it is modelled",
    ("elbow",): "lock is 'elbow'; it must be JOINT=VALUE, such as wrist=0.5",
}


@pytest.mark.parametrize("lock", list(REFUSED))
def test_locks_that_cannot_be(tmp_path, lock) -> None:
    path = tmp_path / "torso.xml"
    path.write_text(TORSO, encoding="utf-8")
    with pytest.raises(InputError, match=REFUSED[lock]):
        load_model(path, lock)
    with pytest.raises(InputError, match="base: unknown body name 'arm'; the body names are torso, leg"):
        load_model(path, base="arm")


def advised(path: Path) -> list[tuple[dict[str, str], str | None]]:
    """Locks and base that a refusal says to type: each kind alone."""
    with pytest.raises(InputError) as refused:
        load_model(path)
    text = str(refused.value)
    assert "\n" not in text
    found = [shlex.split(value)[0] for value in re.findall(r"--lock ('[^']*'|[^\s;,)]+)", text)]
    bases = [shlex.split(value)[0] for value in re.findall(r"--base ('[^']*'|[^\s;,)]+)", text)]
    locks = dict(entry.rsplit("=", 1) for entry in found)
    return [(locks, None)] * bool(locks) + [({}, base) for base in bases]


def test_advice_for_a_base_that_floats_works(tmp_path) -> None:
    path = tmp_path / "torso.xml"
    path.write_text(TORSO, encoding="utf-8")
    (locks, _), (_, base) = advised(path)
    assert locks == {"root": "0"}
    assert load_model(path, locks).joints == ("hip", "yaw", "pitch", "out", "elbow", "grip")
    assert load_model(path, base=base).joints == ("yaw", "pitch", "out", "elbow", "grip")


def test_advice_for_objects_beside_the_arm_and_loops_of_a_gripper_works(tmp_path) -> None:
    ball = '<body name="ball"><freejoint/><geom size="0.05"/></body>'
    loop = '<equality><connect body1="finger" body2="fore" anchor="0 0 0.1"/></equality>'
    fixed = TORSO.replace('<freejoint name="root"/>', "").replace("</worldbody>", f"{ball}</worldbody>{loop}")
    path = tmp_path / "torso.xml"
    path.write_text(re.sub("<keyframe>.*</keyframe>", "", fixed), encoding="utf-8")
    ((first, _),) = advised(path)
    assert first == {"joint 7 of ball": "0"}
    with pytest.raises(InputError, match=r"closes a chain between finger and fore; lock .* --lock grip=0$"):
        load_model(path, first)
    assert load_model(path, {**first, "grip": "0"}).joints == ("hip", "yaw", "pitch", "out", "elbow")


def test_a_value_that_is_advised_is_within_the_range(tmp_path) -> None:
    """The reference pose is out of the grip's range, and its nearest end has more digits than are usually printed."""
    loop = '<equality><connect body1="finger" body2="fore" anchor="0 0 0.1"/></equality>'
    fixed = TORSO.replace('<freejoint name="root"/>', "").replace("</worldbody>", f"</worldbody>{loop}")
    fixed = fixed.replace('range="0 0.04"', 'range="-20 -12.345641"')
    path = tmp_path / "torso.xml"
    path.write_text(re.sub("<keyframe>.*</keyframe>", "", fixed), encoding="utf-8")
    ((locks, _),) = advised(path)
    assert load_model(path, locks).joints == ("hip", "yaw", "pitch", "out", "elbow")


def test_a_locked_leader_takes_its_follower_along(tmp_path) -> None:
    mimic = '<mimic joint="left_joint" multiplier="-1.5" offset="0.02"/>'
    path = urdf(tmp_path, DUO + jaw("right", -1, mimic) + jaw("left", 1))
    found = load_model(path, ["left_joint=0.01"])
    assert found.joints == ("shoulder", "elbow")
    whole = mujoco.MjModel.from_xml_path(
        str(urdf(tmp_path, DUO + jaw("right", -1) + jaw("left", 1), "plain.urdf"))
    )
    compare(found, whole, {"left_joint": 0.01, "right_joint": 0.005})
    with pytest.raises(InputError, match="lock names right_joint, which follows left_joint; lock left_joint"):
        load_model(path, {"right_joint": 0.0})


def test_gravcomp_is_no_part_of_the_robot(tmp_path) -> None:
    """It is read without, says so, and neither the extended model nor its README hides it."""
    from mocobot_sim.serial.extended import write_extended

    path = tmp_path / "torso.xml"
    plain = TORSO.replace('<freejoint name="root"/>', "")
    plain = re.sub("<keyframe>.*</keyframe>", "", plain)
    path.write_text(
        plain.replace('name="upper"', 'name="upper" gravcomp="1"').replace(
            'name="fore"', 'name="fore" gravcomp="0.5"'
        )
    )
    found = load_model(path)
    same_torques(found, mujoco.MjModel.from_xml_string(plain))
    (note,) = found.notes
    assert note.startswith("The file cancels 50 % to 100 % of gravity by gravcomp on upper, fore,")
    write_extended(found.source.copy(), [], tmp_path / "out", [], notes=found.notes)
    assert "gravcomp" not in (tmp_path / "out" / "robot.xml").read_text()
    assert note in (tmp_path / "out" / "README.md").read_text()


def test_holds_by_mocap_bodies_are_left_out(tmp_path) -> None:
    held = TORSO.replace('<freejoint name="root"/>', "").replace(
        "</worldbody>", '<body name="aim" mocap="true"/></worldbody>'
    )
    held = re.sub("<equality>.*?</equality>", '<equality><weld body1="aim" body2="finger"/></equality>', held)
    path = tmp_path / "torso.xml"
    path.write_text(re.sub("<keyframe>.*</keyframe>", "", held))
    found = load_model(path)
    assert len(found.joints) == 6
    assert any("left out: they hold finger" in note for note in found.notes)


SPOILT = {
    "NaN mass": ('value="2.5"', 'value="nan"', "<mass> has value = 'nan'; every number must be a finite one"),
    "NaN inertia": ('ixy="0"', 'ixy="NaN"', "<inertia> has ixy = 'NaN'"),
    "infinite inertia": ('ixx="0.006"', 'ixx="inf"', "link boom has an inertia that is not finite"),
    "infinite mass": ('value="2.5"', 'value="inf"', "body_mass of entry 1 is inf"),
    "infinite place": ('xyz="0.35 0 0"', 'xyz="inf 0 0"', "body_pos of entry 2 is"),
    "a name twice": ('name="elbow"', 'name="shoulder"', "repeated name 'shoulder' in joint"),
    "singular": ('ixz="0.0003"', 'ixz="1e300"', "Inertia matrix is too close to singular"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(SPOILT))
def test_numbers_and_names_that_no_model_has_are_refused(tmp_path, case) -> None:
    good, bad, said = SPOILT[case]
    assert good in DUO
    text = DUO.replace(good, bad)
    path = urdf(tmp_path, text)
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        load_model(path)
    assert str(refused.value).startswith(f"{path}: ")


def test_a_limit_may_be_infinite(tmp_path) -> None:
    assert load_model(urdf(tmp_path, DUO.replace('effort="50"', 'effort="inf"'))).joints == (
        "shoulder",
        "elbow",
    )


def test_no_joint_is_locked_at_infinity(tmp_path) -> None:
    path = urdf(tmp_path, DUO.replace("revolute", "continuous"))
    with pytest.raises(InputError, match="lock of elbow is '1e999'; it must be a number in rad"):
        load_model(path, ["elbow=1e999"])
