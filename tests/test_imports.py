"""Imports run one way: estimator <- mocobot_sim <- discrepancy <- mocobot_report <- mocobot (the command line), and
estimator <- mocobot_logs <- mocobot."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[1] / "src"
LAYERS = ["estimator", "mocobot_sim", "discrepancy", "mocobot_report", "mocobot"]
ESTIMATOR_MAY_IMPORT = {"estimator", "numpy", "scipy"} | set(sys.stdlib_module_names)


def imported_roots(path: Path) -> set[str]:
    roots = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            roots |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            roots.add((node.module or "").split(".")[0])
    return roots


def source_files(package: str) -> list[Path]:
    return sorted((SRC / package).rglob("*.py"))


@pytest.mark.parametrize("package", [name for name in LAYERS if (SRC / name).is_dir()])
def test_no_layer_imports_a_later_one(package: str) -> None:
    files = source_files(package)
    assert files
    later = set(LAYERS[LAYERS.index(package) + 1 :])
    for path in files:
        assert not imported_roots(path) & later, path


def test_logs_need_the_estimator_only() -> None:
    """Measured logs can be read where there is no simulator, and the simulator knows nothing of them."""
    files = source_files("mocobot_logs")
    assert len(files) > 10
    for path in files:
        assert not imported_roots(path) & {
            "mocobot_sim", "discrepancy", "mocobot_report", "mocobot", "mujoco", "dm_control"
        }, path  # fmt: skip
    for package in ("estimator", "mocobot_sim", "discrepancy", "mocobot_report"):
        for path in source_files(package):
            assert "mocobot_logs" not in imported_roots(path), path


def test_logs_are_read_without_the_simulator() -> None:
    code = (
        "import sys; import pkgutil, importlib, mocobot_logs\n"
        "for m in pkgutil.walk_packages(mocobot_logs.__path__, 'mocobot_logs.'): importlib.import_module(m.name)\n"
        "assert 'mocobot_logs.open_log' in sys.modules\n"
        "assert not {'mujoco', 'dm_control', 'numba', 'mocobot_sim', 'discrepancy', 'mocobot'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_estimator_needs_numpy_and_scipy_only() -> None:
    files = source_files("estimator")
    assert len(files) > 10
    for path in files:
        allowed = ESTIMATOR_MAY_IMPORT | ({"pyarrow"} if path.name == "recording.py" else set())
        assert imported_roots(path) <= allowed, path


def test_estimator_runs_without_mujoco() -> None:
    code = (
        "import sys; import pkgutil, importlib, estimator\n"
        "for m in pkgutil.walk_packages(estimator.__path__, 'estimator.'): importlib.import_module(m.name)\n"
        "assert 'estimator.design' in sys.modules\n"
        "assert not {'mujoco', 'dm_control', 'numba', 'mocobot_sim'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def imported_modules(path: Path) -> set[str]:
    """Full names of the modules, and of what is taken from them."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


def test_engine_of_the_diagnosis_knows_no_rig() -> None:
    """What looks for causes works for any rig: it sees neither the team of Omnids nor the simulator."""
    files = sorted((SRC / "discrepancy").glob("*.py"))
    assert len(files) > 8
    for path in files:
        names = imported_modules(path)
        roots = {name.split(".")[0] for name in names}
        assert not roots & {"mocobot_sim", "mujoco", "dm_control"}, path
        assert not any(f"{name}.".startswith("discrepancy.team.") for name in names), path


def test_causes_need_no_simulator() -> None:
    """Traces of causes come from mechanics, not from the simulator that the diagnosis is tried on."""
    files = sorted((SRC / "discrepancy" / "team" / "causes").glob("*.py"))
    assert len(files) > 20
    for path in files:
        assert not imported_roots(path) & {"mocobot_sim", "mujoco", "dm_control"}, path


def test_engine_of_the_diagnosis_runs_without_the_simulator() -> None:
    code = (
        "import sys, discrepancy.diagnose\n"
        "assert not {'mujoco', 'mocobot_sim', 'discrepancy.team'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
