"""Which models are read, and what is said of the others."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import load_model
from estimator.errors import InputError

MODELS = Path(__file__).resolve().parents[3] / "models"
BODY = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>'
LINKS = f"""
<body name="a">{BODY}<joint name="one" range="-1 2" actuatorfrcrange="-5 5"/>
  <body name="b" pos="0 0 0.2">{BODY}<joint name="two" type="slide"/>
    <site name="end"/></body></body>
"""
URDF = """<?xml version="1.0"?>
<robot name="r">
  <link name="base"><collision><geometry><mesh filename="package://r/base.stl"/></geometry></collision></link>
  <link name="a">
    <inertial><origin xyz="0 0 0.1"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="package://r/a.stl"/></geometry></collision>
  </link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="5" velocity="3"/></joint>
</robot>
"""


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def mjcf(bodies: str, more: str = "") -> str:
    return f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody>{more}</mujoco>'


def test_a_tree_of_hinges_and_slides_is_read(tmp_path) -> None:
    more = (
        '<actuator><motor joint="two" gear="3" forcerange="-2 2"/><motor joint="two" forcerange="-1 1"/>'
        '<motor joint="one" forcerange="-7 7"/></actuator>'
    )
    found = load_model(written(tmp_path, mjcf(LINKS, more)))
    assert found.joints == ("one", "two")
    assert found.bodies == ("a", "b")
    assert found.slides.tolist() == [False, True]
    assert found.lower.tolist() == [-1.0, -np.inf]
    assert found.upper.tolist() == [2.0, np.inf]
    assert found.torque_limit.tolist() == [5.0, 7.0]


def test_urdf_without_its_meshes_is_read(tmp_path) -> None:
    found = load_model(written(tmp_path, URDF, "robot.urdf"))
    assert found.joints == ("j1",)
    assert found.model.body("a").mass[0] == 1.0
    assert found.torque_limit.tolist() == [5.0]


def test_urdf_whose_moving_links_have_no_mass_is_refused(tmp_path) -> None:
    without = URDF[: URDF.index("<inertial>")] + URDF[URDF.index("</inertial>") + 11 :]
    with pytest.raises(InputError, match="no link that moves has a mass; give the links their <inertial>"):
        load_model(written(tmp_path, without, "robot.urdf"))


MESHES = '<asset><mesh name="gone" file="gone.obj"/></asset>'
LOST = {
    "beside a shape": (
        '<body name="a"><joint name="one"/><geom size="0.1"/><geom type="mesh" mesh="gone"/></body>', "'a'"
    ),
    "of what is welded on": (
        f'<body name="a"><joint name="one"/>{BODY}<body name="tool"><geom type="mesh" mesh="gone"/></body></body>',
        "'tool'",
    ),
    "of a body without a name": (
        '<body><joint name="one"/><geom size="0.1"/><geom type="mesh" mesh="gone"/></body>', "a body without a name"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(LOST))
def test_a_mesh_that_is_missed_and_has_mass_is_no_mesh_to_leave_out(tmp_path, case) -> None:
    bodies, said = LOST[case]
    with pytest.raises(InputError, match=f"gone.obj.*; without its meshes: the inertia of .*{said}"):
        load_model(written(tmp_path, mjcf(bodies, MESHES)))


def test_a_mesh_that_is_missed_and_has_no_part_in_what_moves_is_left_out(tmp_path) -> None:
    bodies = (
        '<body name="stand"><geom type="mesh" mesh="gone"/></body>'
        f'<body name="a"><joint name="one"/>{BODY}<geom type="mesh" mesh="gone"/></body>'
        '<body name="b"><joint name="two"/><geom size="0.1" mass="1"/><geom type="mesh" mesh="gone" mass="0"/></body>'
    )
    found = load_model(written(tmp_path, mjcf(bodies, MESHES)))
    assert found.model.body_mass.tolist() == [0.0, 0.0, 1.0, 1.0]


def test_gravity_that_is_switched_off_is_none(tmp_path) -> None:
    found = load_model(written(tmp_path, mjcf(LINKS, '<option><flag gravity="disable"/></option>')))
    assert not Tree.of(found.model).gravity.any()


@pytest.mark.parametrize("name", ["tx40", "xl330", "panda", "emps"])
def test_own_models_are_read(name) -> None:
    assert load_model(MODELS / name / f"{name}.xml").joints


REFUSED = {
    "no joints": (mjcf(f"<body>{BODY}</body>"), "the model has no joints that turn or slide"),
    "free alone": (mjcf(f'<body><freejoint name="f"/>{BODY}</body>'), "the model has no joints that turn or slide"),
    "closed": (
        mjcf(LINKS, '<equality><connect body1="a" body2="b" anchor="0 0 1"/></equality>'),
        "closes a chain between a and b; lock these joints where they stood, for example --lock two=0$",
    ),
    "closed wholly": (
        mjcf(LINKS, '<equality><connect body1="b" anchor="0 0 1"/></equality>'),
        "closes a chain between b and world, and all joints are part of such chains; only trees",
    ),
    "bent": (
        mjcf(LINKS, '<equality><joint joint1="one" joint2="two" polycoef="0 1 2 0 0"/></equality>'),
        "joint 'one' follows another by a polynomial",
    ),
    "in a circle": (
        mjcf(LINKS, '<equality><joint joint1="one" joint2="two"/><joint joint1="two" joint2="one"/></equality>'),
        r"follow each other in a circle \(one, two\)",
    ),
    "xacro": ('<robot xmlns:xacro="x"><xacro:arg name="a" default="1"/></robot>', "ros2 run xacro xacro .* > robot"),
    "text": ("robot", "not a readable MJCF"),
    "empty": ("", "not a readable MJCF"),
    "other": ("<robot_description/>", "MuJoCo cannot read it"),
    "massless": (mjcf('<body name="a"><joint name="one"/></body>'), "MuJoCo cannot compile it"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(REFUSED))
def test_others_are_refused_in_one_sentence(tmp_path, case) -> None:
    text, said = REFUSED[case]
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=said) as refused:
        load_model(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


def test_the_command_for_a_xacro_file_can_be_pasted(tmp_path) -> None:
    (tmp_path / "my robot").mkdir()
    path = written(tmp_path / "my robot", REFUSED["xacro"][0])
    with pytest.raises(InputError) as refused:
        load_model(path)
    command = shlex.split(str(refused.value).partition("make a URDF of it: ")[2])
    assert command == ["ros2", "run", "xacro", "xacro", str(path), ">", "robot.urdf"]


def test_no_file_and_no_model(tmp_path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_model(tmp_path / "none.xml")
    with pytest.raises(InputError, match="there is no such file"):
        load_model(tmp_path)
    (tmp_path / "bytes.xml").write_bytes(bytes(range(256)) * 8)
    with pytest.raises(InputError, match="not a readable MJCF"):
        load_model(tmp_path / "bytes.xml")


def test_shipped_omnid_is_refused_for_its_closed_chains() -> None:
    with pytest.raises(InputError, match="closes a chain between rod1 and platform; lock these joints where"):
        load_model(MODELS / "omnid" / "omnid.xml")


def test_a_fixed_link_of_a_urdf_without_an_inertial_has_no_mass(tmp_path: Path) -> None:
    text = """<robot name="r"><link name="base"/>
    <link name="arm"><inertial><mass value="2"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="hull"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
    <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
    <joint name="mount" type="fixed"><parent link="arm"/><child link="hull"/></joint></robot>"""
    (tmp_path / "r.urdf").write_text(text, encoding="utf-8")
    assert load_model(tmp_path / "r.urdf").model.body("arm").mass[0] == 2.0


def test_bodies_without_a_name_get_one_from_their_joint(tmp_path: Path) -> None:
    """Findings name bodies; the one that has the name already keeps it."""
    inside = f'<body name="link of one">{BODY}<joint name="two"/><body>{BODY}</body></body>'
    model = load_model(written(tmp_path, mjcf(f'<body>{BODY}<joint name="one"/>{inside}</body>')))
    assert [model.model.body(b).name for b in range(4)] == [
        "world",
        "link of one (1)",
        "link of one",
        "body 3",
    ]
