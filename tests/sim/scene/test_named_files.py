"""Copies of a model take its own files alone: at or below its folder, links resolved, of a mesh's or texture's type."""

from __future__ import annotations

import shutil
import struct
import zlib
from pathlib import Path

import pytest

from discrepancy.joints.reading import read_spec
from estimator.errors import InputError
from mocobot_sim.extended.extended import load_extended, write_extended
from mocobot_sim.model_check import check_named
from mocobot_sim.scene.models import payload_path
from mocobot_sim.scene.payload import load_payload
from mocobot_sim.scene.scene import build_team
from mocobot_sim.serial import extended as serial

CUBE = (
    "".join(f"v {x} {y} {z}\n" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
    + "f 1 2 3\nf 4 5 6\nf 7 8 1\nf 2 5 7\n"
)
ARM = (
    '<mujoco>{head}<asset>{asset}</asset><worldbody><body><joint name="j1"/><geom size=".1"/></body></worldbody>'
    "</mujoco>"
)


def png(colour: int = 7) -> bytes:
    """One grey pixel."""

    def part(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    head = part(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + part(b"IDAT", zlib.compress(bytes([0, colour]))) + part(b"IEND", b"")


def cube_texture(file: str) -> str:
    return f'<texture name="t" type="2d" file="{file}"/>'


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model's folder beside files that are not its own."""
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "secret.obj").write_text(CUBE)
    (tmp_path / "secret.png").write_bytes(png())
    (tmp_path / "secret.xml").write_text("<mujoco><size memory='1M'/></mujoco>")
    folder = tmp_path / "model"
    (folder / "parts").mkdir(parents=True)
    (folder / "notes.txt").write_text("secret")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    (folder / "inside.png").symlink_to(folder / "notes.txt")
    for name in ("parts/own.obj", "own.obj"):
        (folder / name).write_text(CUBE)
    (folder / "own.png").write_bytes(png())
    (folder / "own.xml").write_text("<mujoco><size memory='1M'/></mujoco>")
    return folder / "robot.xml"


OUTSIDE, TYPE = "lies outside the model's folder", "takes only files of the types .stl, .obj"
ASSETS = [
    ('<mesh name="m" file="{above}/secret.obj"/>', OUTSIDE),
    ('<mesh name="m" file="../secret.obj"/>', OUTSIDE),
    ('<texture name="t" type="2d" file="{above}/secret.png"/>', OUTSIDE),
    ('<texture name="t" type="2d" file="link.png"/>', OUTSIDE),
    ('<texture name="t" type="cube" fileright="own.png" fileleft="own.png" fileup="own.png" filedown="own.png" '
     'filefront="own.png" fileback="../secret.png"/>', OUTSIDE),
    ('<texture name="t" type="2d" file="notes.txt" content_type="image/ktx"/>', TYPE),
    ('<texture name="t" type="2d" file="inside.png" content_type="image/ktx"/>', TYPE),
    ('<hfield name="h" size="1 1 1 1" file="../secret.png"/>', OUTSIDE),
]  # fmt: skip


@pytest.mark.parametrize(("asset", "said"), ASSETS)
def test_a_robot_takes_nothing_else_along(model: Path, asset: str, said: str) -> None:
    model.write_text(ARM.format(head="", asset=asset.format(above=model.parents[1])))
    out = model.parents[1] / "out"
    with pytest.raises(InputError, match=said):
        serial.write_extended(read_spec(model).spec, [], out, ["log"])
    assert not out.exists()


@pytest.mark.parametrize("asset", ['<mesh name="m" file="parts/own.obj"/>', cube_texture("own.png")])
def test_a_robot_takes_its_own_files_along(model: Path, asset: str) -> None:
    model.write_text(ARM.format(head="", asset=asset))
    serial.write_extended(read_spec(model).spec, [], out := model.parents[1] / "out", ["log"])
    assert [path.name[:4] for path in (out / "assets").iterdir()] == ["own."]
    shutil.rmtree(model.parent)
    read_spec(out / "robot.xml")


def test_a_urdf(model: Path) -> None:
    urdf = model.with_name("robot.urdf")
    urdf.write_text(
        '<robot name="r"><mujoco><compiler strippath="false" discardvisual="false"/></mujoco><link name="base"/><link '
        'name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<visual><geometry><mesh filename="../secret.obj"/></geometry></visual></link><joint name="j" '
        'type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint></robot>'
    )
    with pytest.raises(InputError, match=OUTSIDE):
        serial.write_extended(read_spec(urdf).spec, [], model.parents[1] / "out", ["log"])


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ('<include file="{above}/secret.xml"/>', OUTSIDE),
        ('<include file="../secret.xml"/>', OUTSIDE),
        ('<include file="link.xml"/>', OUTSIDE),
        ('<asset><model name="m" file="../secret.xml"/></asset>', OUTSIDE),
        ('<include file="notes.txt"/>', "takes only files of the types .xml, .mjcf, .urdf"),
        ("<!DOCTYPE m [<!ENTITY e 'x'>]>", "what it includes cannot be told"),
        ('<include file="own.xml"/>', None),
        ('<include file="missing.xml"/>', None),
    ],
)
def test_models_that_a_model_includes(model: Path, head: str, said: str | None) -> None:
    text = ARM.format(head=head.format(above=model.parents[1]), asset="")
    if head.startswith("<!"):
        text = head + ARM.format(head="", asset="")
    model.write_text(text)
    if said is None:
        check_named(model, assets=False)
        return
    with pytest.raises(InputError, match=said):
        check_named(model, assets=False)
    (model.parent / "over.xml").write_text(text)
    model.write_text(ARM.format(head='<include file="over.xml"/>', asset=""))
    with pytest.raises(InputError, match=said):
        check_named(model, assets=False)


@pytest.mark.parametrize(("asset", "said"), ASSETS)
def test_a_payload_has_nothing_else(model: Path, asset: str, said: str) -> None:
    text = payload_path("a").read_text()
    asset = asset.format(above=model.parents[1])
    model.write_text(text.replace("<worldbody>", f"<asset>{asset}</asset><worldbody>", 1))
    with pytest.raises(InputError, match=f"{said}|not a readable MJCF"):  # PyMJCF knows no KTX
        load_payload(model)


def test_an_extended_team_keeps_its_own_files(model: Path) -> None:
    """Meshes go with it; what a link in its folder leads to, and anything else there, does not."""
    text = payload_path("a").read_text()
    asset = '<asset><mesh name="mine" file="own.obj"/></asset>'
    geom = '<geom type="mesh" mesh="mine" mass="0" contype="0" conaffinity="0"/>'
    text = text.replace("<worldbody>", f"{asset}<worldbody>", 1)
    at = text.index("<site")
    model.write_text(text[:at] + geom + text[at:])
    write_extended(build_team(model), [], out := model.parents[1] / "out", {})
    (out / "mine.txt").write_text("secret")
    assert [name.rsplit(".")[-1] for name in load_extended(out).assets] == ["obj"]
    (out / "link.png").symlink_to(model.parents[1] / "secret.png")
    with pytest.raises(InputError, match=OUTSIDE):
        load_extended(out)
