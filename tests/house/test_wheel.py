"""An installed wheel carries the models and the paper's tables, and works away from the repository."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_wheel_simulates_on_its_own(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for package in (ROOT / "src").glob("*/__init__.py"):
        assert (site / package.parent.name / "py.typed").is_file()
    code = (
        "import mocobot.cli, mocobot.commands.diagnose, mocobot_sim.scene.models as m;"
        "import mocobot_sim.paper.published as t;"
        "print(m.models_dir());"
        "import mocobot_report.document as r; r.page_assets();"
        "import mocobot_logs.map.files as l; [l.builtin_map(name) for name in l.MAPS];"
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
