"""The engine knows nothing of the axis, and the axis' traces know nothing of the simulator."""

from __future__ import annotations

import subprocess
import sys

from test_imports import SRC, imported_modules, imported_roots


def test_engine_knows_no_axis() -> None:
    files = sorted((SRC / "discrepancy").glob("*.py"))
    assert len(files) > 8
    for path in files:
        assert not any(name.startswith("discrepancy.emps") for name in imported_modules(path)), path


def test_rigs_do_not_know_each_other() -> None:
    files = sorted((SRC / "discrepancy" / "emps").rglob("*.py"))
    assert len(files) > 20
    for path in files:
        assert not any(name.startswith("discrepancy.team") for name in imported_modules(path)), path


def test_traces_need_no_simulator() -> None:
    for path in sorted((SRC / "discrepancy" / "emps" / "causes").glob("*.py")):
        assert not imported_roots(path) & {"mocobot_sim", "mujoco", "dm_control"}, path
    code = (
        "import sys, discrepancy.emps.causes\n"
        "assert not {'mujoco', 'mocobot_sim', 'discrepancy.team'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
