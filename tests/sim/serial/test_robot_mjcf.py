"""Causes put into a model, however it is written: inertias, positions, and the files that it needs."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.joints.mechanics import Motion, Tree, body_regressor, inertial_parameters, inverse_torque
from discrepancy.joints.reading import read_spec
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import write_extended
from mocobot_sim.serial.mjcf import into_mjcf, real_inertia


def compiled(inertia: np.ndarray) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.mass, body.explicitinertial = 1.0, True
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return spec.compile()


def test_a_body_keeps_its_inertia() -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
    np.testing.assert_allclose(real_inertia(inertia), inertia, atol=1e-16)


@pytest.mark.parametrize("moments", [(1e-4, 3e-4, 1.2e-3), (-1e-3, 2e-3, 2e-3), (1e-3, 1e-3, -5e-4)])
def test_what_no_body_can_have_becomes_the_nearest_that_one_can(moments: tuple[float, float, float]) -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    inertia = turn @ np.diag(moments) @ turn.T
    with pytest.raises(ValueError, match="inertia"):
        compiled(inertia)
    real = real_inertia(inertia)
    kept = np.sort(compiled(real).body_inertia[1])
    assert kept[0] + kept[1] >= kept[2]
    # Second moments along the same axes; those above zero are as they were.
    before = 0.5 * sum(moments) - np.array(moments)
    after = np.diag(turn.T @ (0.5 * np.trace(real) * np.eye(3) - real) @ turn)
    np.testing.assert_allclose(after, np.maximum(before, 1e-3 * before.max()), atol=1e-15)


LINKS = """<mujoco><compiler {compiler}/><worldbody><body {first}><joint name="j1" axis="0 1 0" ref="{ref}"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="2"/>
<body {second} pos=".4 0 0"><joint name="j2" axis="0 1 0" ref="{ref}"/>{inertial}
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/></body></body></worldbody></mujoco>"""
PLAIN = {"compiler": "", "first": 'name="a"', "second": 'name="b"', "ref": "0", "inertial": ""}
GIVEN = '<inertial pos=".1 .02 0" mass="1" {}/>'
WAYS = {
    "by its shapes": {},
    "diagonal": {"inertial": GIVEN.format('diaginertia=".01 .02 .025"')},
    "along other axes": {"inertial": GIVEN.format('diaginertia=".01 .02 .025" euler="10 20 30"')},
    "full": {"inertial": GIVEN.format('fullinertia=".01 .02 .025 .001 .001 .001"')},
    "shapes whatever is given": {
        "compiler": 'inertiafromgeom="true"', "inertial": GIVEN.format('diaginertia=".01 .02 .025"')
    },
    "no less than": {"compiler": 'boundmass="1.5" boundinertia="0.05"'},
    "bodies without names": {"first": "", "second": ""},
}  # fmt: skip
OFF = {
    "link_mass": {"excess_kg": 0.3},
    "link_com": {"x_m": 0.02, "y_m": 0.01, "z_m": 0.0},
    "link_inertia": {"share": 0.3},
    "payload": {"mass_kg": 0.5, "x_m": 0.2, "y_m": 0.02, "z_m": 0.01}
    | dict.fromkeys([f"inertia_{axes}_kgm2" for axes in ("xx", "yy", "zz")], 0.002)
    | dict.fromkeys([f"inertia_{axes}_kgm2" for axes in ("xy", "xz", "yz")], 0.0),
}


def extended(text: str, effect: RobotEffect) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    """The model, and the one with an effect in it."""
    spec = mujoco.MjSpec.from_string(text)
    before = mujoco.MjSpec.from_string(text).compile()
    assert into_mjcf(spec, effect)
    return before, mujoco.MjModel.from_xml_string(compiled_text(spec))


def compiled_text(spec: mujoco.MjSpec) -> str:
    spec.compile()
    return spec.to_xml()


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("cause", OFF)
@pytest.mark.parametrize("way", WAYS)
def test_inertia_is_put_in_whatever_way_the_model_gives_it_in(way: str, cause: str, joint: int) -> None:
    before, after = extended(LINKS.format(**PLAIN | WAYS[way]), RobotEffect(cause, joint, None, OFF[cause]))
    states = np.random.default_rng(0).standard_normal((3, 20, 2))
    moved = Motion.of(Tree.of(before), *states)
    tree, number = moved.tree, OFF[cause]
    centre = np.array([number.get(f"{axis}_m", 0.0) for axis in "xyz"])
    mass, com, inertia = tree.mass[joint], tree.com[joint], tree.inertia[joint]
    own = inertial_parameters(mass, com, inertia)
    if cause == "payload":
        more = inertial_parameters(0.5, centre, 0.002 * np.eye(3))
    elif cause == "link_mass":
        more = inertial_parameters(0.3, com, 0.0 * inertia)
    elif cause == "link_com":
        more = inertial_parameters(mass, com + centre, inertia) - own
    else:
        more = inertial_parameters(0.0, com, 0.3 * inertia)
    wanted = inverse_torque(before, *states) + body_regressor(moved, joint) @ more
    np.testing.assert_allclose(inverse_torque(after, *states), wanted, atol=1e-4)


@pytest.mark.parametrize(
    ("compiler", "ref"), [("", 30.0), ('angle="degree"', -20.0), ('angle="radian"', 0.4)]
)
def test_positions_are_in_the_unit_in_which_the_model_has_angles(compiler: str, ref: float) -> None:
    text = LINKS.format(**PLAIN | {"compiler": compiler, "ref": ref})
    states = np.random.default_rng(0).standard_normal((3, 20, 2))
    before, after = extended(text, RobotEffect("joint_zero", 2, None, {"zero_rad": 0.05}))
    stands = [states[0] + [0.0, 0.05], *states[1:]]
    np.testing.assert_allclose(inverse_torque(after, *states), inverse_torque(before, *stands), atol=1e-4)
    spring = {"stiffness_Nm_per_rad": 3.0, "middle_rad": 0.5, "offset_Nm": 0.9}
    before, after = extended(text, RobotEffect("spring", 2, None, spring))
    wanted = inverse_torque(before, *states)
    wanted[:, 1] += 3.0 * (states[0][:, 1] - 0.2)
    np.testing.assert_allclose(inverse_torque(after, *states), wanted, atol=1e-4)


def test_a_link_that_would_have_no_mass_is_not_put_in() -> None:
    spec = mujoco.MjSpec.from_string(LINKS.format(**PLAIN))
    assert not into_mjcf(spec, RobotEffect("link_mass", 2, None, {"excess_kg": -1.0}))


CUBE = "\n".join([
    *(f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)),
    *(f"f {k}" for k in ("1 2 4", "1 4 3", "5 7 8", "5 8 6", "1 5 6", "1 6 2", "3 4 8", "3 8 7", "1 3 7", "1 7 5")),
    "f 2 6 8", "f 2 8 4",
])  # fmt: skip


def test_meshes_are_taken_along(tmp_path, monkeypatch) -> None:
    for folder in ("parts", "others"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "cube.obj").write_text(CUBE)
    (tmp_path / "robot.xml").write_text(
        '<mujoco><compiler meshdir="parts"/><asset><mesh name="one" file="cube.obj"/>'
        '<mesh name="two" file="../others/cube.obj" scale="2 2 2"/></asset><worldbody><body><joint name="j1"/>'
        '<geom type="mesh" mesh="one"/><geom type="mesh" mesh="two"/></body></worldbody></mujoco>'
    )
    spec = read_spec(tmp_path / "robot.xml").spec
    write_extended(
        spec, [RobotEffect("armature", 1, None, {"armature_kgm2": 0.1})], tmp_path / "out", ["log"]
    )
    (tmp_path / "out").rename(tmp_path / "elsewhere")
    for folder in ("parts", "others"):
        (tmp_path / folder / "cube.obj").unlink()
    monkeypatch.chdir("/")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "elsewhere" / "robot.xml"))
    assert model.body_mass[1] == pytest.approx(1000.0 * (8.0 + 64.0))
    assert sorted(path.name for path in (tmp_path / "elsewhere" / "assets").iterdir()) == [
        "1_cube.obj",
        "cube.obj",
    ]
