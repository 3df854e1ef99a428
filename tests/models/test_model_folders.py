"""Lint of every model folder: it explains itself, runs alone, and names everything."""

import re
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest

MODELS = Path(__file__).resolve().parents[2] / "models"
FOLDERS = sorted(path for path in MODELS.iterdir() if path.is_dir())
FOLDER_NAMES = ["emps", "omnid", "panda", "payload_a", "payload_b", "payload_c", "payload_d",
                "payload_flexible", "payload_folding", "payload_hinged", "payload_sliding", "six_axis", "team_a",
                "tx40", "xl330"]  # fmt: skip
XML_FILES = sorted(MODELS.glob("**/*.xml"))
NAMED = ("BODY", "JOINT", "GEOM", "SITE", "CAMERA", "LIGHT", "EQUALITY", "TENDON", "ACTUATOR", "SENSOR")
NAMED_ASSETS = ("MATERIAL", "TEXTURE")

# A path that starts at the root of a file system, outside a URL.
ABSOLUTE_PATH = re.compile(r"""(?:^|[\s"'(=])(?:/[\w.-]+/[\w./-]+|~/|[A-Za-z]:\\)""", re.MULTILINE)


def _each_folder():
    return pytest.mark.parametrize("folder", FOLDERS, ids=[folder.name for folder in FOLDERS])


def _each_xml():
    return pytest.mark.parametrize(
        "path", XML_FILES, ids=[path.relative_to(MODELS).as_posix() for path in XML_FILES]
    )


def test_the_folders_are_the_shipped_models():
    assert [folder.name for folder in FOLDERS] == FOLDER_NAMES
    assert len(XML_FILES) >= 2 * len(FOLDER_NAMES)


@_each_folder()
def test_folder_has_the_files_that_explain_it(folder):
    for name in ("README.md", "CHANGELOG.md", "scene.xml"):
        assert (folder / name).is_file(), f"{folder.name}/{name} is missing"
    readme = (folder / "README.md").read_text(encoding="utf-8")
    for heading in ("## Overview", "## Origin of the numbers", "## Not modelled"):
        assert heading in readme, f"{folder.name}/README.md lacks the section {heading!r}"
    changelog = (folder / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## \d+\.\d+\.\d+$", changelog, re.MULTILINE), "no version heading"


def test_index_links_every_folder():
    index = (MODELS / "README.md").read_text(encoding="utf-8")
    for folder in FOLDERS:
        assert f"]({folder.name}/README.md)" in index


@_each_folder()
def test_scene_runs_a_second_without_warnings(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data = mujoco.MjData(model)
    # Counted, not timed: MuJoCo answers an instability by resetting the clock too.
    for _ in range(round(1.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    counts = {mujoco.mjtWarning(i).name: int(n) for i, n in enumerate(data.warning.number) if n}
    assert counts == {}
    for state in (data.qpos, data.qvel, data.qacc, data.xpos):
        assert np.isfinite(state).all()


@_each_xml()
def test_everything_is_named(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    counts = {"BODY": model.nbody, "JOINT": model.njnt, "GEOM": model.ngeom, "SITE": model.nsite,
              "CAMERA": model.ncam, "LIGHT": model.nlight, "EQUALITY": model.neq, "TENDON": model.ntendon,
              "ACTUATOR": model.nu, "SENSOR": model.nsensor, "MATERIAL": model.nmat,
              "TEXTURE": model.ntex}  # fmt: skip
    assert sum(counts.values()) > 1
    for kind in NAMED + NAMED_ASSETS:
        obj = getattr(mujoco.mjtObj, f"mjOBJ_{kind}")
        unnamed = [i for i in range(counts[kind]) if not mujoco.mj_id2name(model, obj, i)]
        assert unnamed == [], f"{path.name}: unnamed {kind.lower()} {unnamed}"


@pytest.mark.parametrize(
    "path",
    [*XML_FILES, *sorted(MODELS.glob("**/*.md")), *sorted(MODELS.glob("**/*.toml"))],
    ids=lambda path: path.relative_to(MODELS).as_posix(),
)
def test_no_absolute_paths(path):
    text = re.sub(r"`/omnidN/[\w/]+`", "", path.read_text(encoding="utf-8"))  # ROS 2 names, not files
    found = ABSOLUTE_PATH.search(text)
    assert found is None, f"{path.name}: absolute path {found.group().strip()!r}"


def test_absolute_paths_are_recognised():
    for text in ('file="/srv/models/x.stl"', "see /srv/data/notes", "(~/models", r'"C:\models'):
        assert ABSOLUTE_PATH.search(text), text
    for text in ("https://github.com/a/b", "models/omnid/scene.xml", "a / b", "0.5/2", "<mujoco/>"):
        assert not ABSOLUTE_PATH.search(text), text


def _design_rows() -> dict[str, list[str]]:
    """Rows of the README's table of design numbers: key -> cells after the key."""
    readme = (MODELS / "omnid" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|$", readme, re.MULTILINE)
    assert len(rows) == len({key for key, _ in rows}), "a key appears twice"
    return {key: [cell.strip() for cell in cells.split("|")] for key, cells in rows}


def test_readme_gives_the_origin_of_every_design_number():
    text = (MODELS / "omnid" / "design.toml").read_text(encoding="utf-8")
    design = tomllib.loads(text)
    rows = _design_rows()
    assert sorted(rows) == sorted(design)
    for key, value in design.items():
        number, status, reason = rows[key]
        expected = value if isinstance(value, list) else [value]
        # Scientific notation and a remark in parentheses are allowed; the value itself must be exact.
        printed = [float(x) for x in re.sub(r"\(.*\)", "", number).replace(",", " ").split()]
        assert printed == expected, f"README says {key} = {number}"
        comment = re.search(rf"^{key} = [^#]*# (\w+)", text, re.MULTILINE)
        assert comment is not None, f"design.toml gives no origin for {key}"
        assert status.split()[0] == comment.group(1), f"{key}: README and design.toml differ on its origin"
        assert len(reason) > 5, f"{key}: no source or reason"
