"""An installed wheel carries the models and the paper's tables, works away from the repository, and the source archive
builds the same one."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def build(target: str, root: Path, out: Path) -> Path:
    """Build without network: hatchling is asked directly."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(out)]
    subprocess.run(command, cwd=root, check=True, capture_output=True)
    (built,) = out.iterdir()
    return built


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


def contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_source_archive_builds_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    with tarfile.open(build("sdist", ROOT, tmp_path / "sdist")) as archive:
        archive.extractall(tmp_path, filter="data")
    (unpacked,) = tmp_path.glob("mocobot-*")
    expected, found = contents(wheel), contents(build("wheel", unpacked, tmp_path / "wheel"))
    assert sorted(found) == sorted(expected)
    assert [name for name in expected if found[name] != expected[name]] == []
    for name in ("LICENSE", "CITATION.cff", "CONTRIBUTING.md", "Makefile", "constraints.txt"):
        assert (unpacked / name).is_file()


def test_the_wheel_says_its_license(wheel: Path) -> None:
    files = contents(wheel)
    (metadata,) = (files[name].decode() for name in files if name.endswith(".dist-info/METADATA"))
    (terms,) = (files[name].decode() for name in files if name.endswith(".dist-info/licenses/LICENSE"))
    assert "License-Expression: Apache-2.0" in metadata.splitlines()
    assert terms.split()[:4] == ["Apache", "License", "Version", "2.0,"]


def test_the_citation_is_of_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    for name in ("version", "license"):
        assert f"{name}: {project[name]}" in lines


@pytest.mark.slow
def test_wheel_simulates_on_its_own(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for package in (ROOT / "src").glob("*/__init__.py"):
        assert (site / package.parent.name / "py.typed").is_file()
    code = (
        "import mocobot.cli, mocobot.commands, mocobot_sim.scene.models as m;"
        "import mocobot_sim.paper.scoring as t;"
        "print(m.models_dir());"
        "import mocobot_report.page as r; r.terms(); r.templates().get_template('page.html');"
        "import mocobot_logs.maps as l; [l.builtin_map(name) for name in l.MAPS];"
        "t.payload_truth('a'); mocobot.cli.main(['simulate', '--vias', '1', '--out', 'rec.parquet'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(site)},
        check=True,
        capture_output=True,
        text=True,
    )
    assert Path(done.stdout.splitlines()[0]).is_relative_to(site)
    assert (tmp_path / "rec.parquet").is_file()
    assert (tmp_path / "rec.truth.json").is_file()
