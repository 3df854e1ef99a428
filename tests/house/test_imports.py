"""Imports run one way and without circles, and each package needs what CONTRIBUTING says of it and nothing more."""

from __future__ import annotations

import subprocess
import sys
from graphlib import CycleError, TopologicalSorter

import pytest

from source_tree import SRC, imported_modules, module_files, project_imports

LOWER = {
    "estimator": set(),
    "mocobot_logs": {"estimator"},
    "mocobot_inspect": {"estimator", "mocobot_logs"},
    "mocobot_sim": {"estimator"},
    "discrepancy": {"estimator", "mocobot_logs", "mocobot_sim"},
    "mocobot_view": {"estimator", "mocobot_logs", "mocobot_sim", "discrepancy"},
    "mocobot_report": {"estimator", "mocobot_sim", "discrepancy", "mocobot_view"},
    "mocobot": {
        "estimator", "mocobot_logs", "mocobot_inspect", "mocobot_sim", "discrepancy", "mocobot_view", "mocobot_report"
    },
}  # fmt: skip
"""What each package may import of the others."""

SIMULATOR = {"mujoco", "dm_control", "mocobot_sim"}


def roots(modules: set[str]) -> set[str]:
    return {name.split(".")[0] for name in modules}


def test_every_package_has_its_layer() -> None:
    assert {path.name for path in SRC.iterdir() if (path / "__init__.py").is_file()} == set(LOWER)


@pytest.mark.parametrize("package", list(LOWER))
def test_no_package_imports_a_later_one(package: str) -> None:
    files = module_files(package)
    assert files
    for module, path in files.items():
        assert roots(imported_modules(path)) & set(LOWER) <= LOWER[package] | {package}, module


@pytest.mark.parametrize(
    ("package", "never"),
    [
        ("evidence", ("team", "joints")),
        ("result", ("team", "joints")),
        ("team", ("joints",)),
        ("joints", ("team",)),
    ],
)
def test_search_and_reports_know_no_machine_and_machines_not_each_other(
    package: str, never: tuple[str, ...]
) -> None:
    files = module_files(f"discrepancy.{package}")
    assert files
    for module, path in files.items():
        taken = {name for name in imported_modules(path) if name.startswith("discrepancy.")}
        assert not {name.split(".")[1] for name in taken} & set(never), module


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [("discrepancy.team.causes", "mocobot_sim"), ("mocobot_sim.effects", "discrepancy")],
)
def test_what_hides_and_what_finds_share_no_code(package: str, forbidden: str) -> None:
    files = module_files(package)
    assert files
    for module, path in files.items():
        assert forbidden not in roots(imported_modules(path)), module


def test_no_module_imports_itself_through_others() -> None:
    """Imports for type checkers count: who has to know whom is the same question."""
    graph = project_imports()
    assert graph
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_estimator_needs_numpy_and_scipy_only() -> None:
    """pyarrow serves the recording's files alone."""
    allowed = {"estimator", "numpy", "scipy"} | set(sys.stdlib_module_names)
    files = module_files("estimator")
    assert files
    for module, path in files.items():
        more = {"pyarrow"} if module == "estimator.recording.parquet" else set()
        assert roots(imported_modules(path)) <= allowed | more, module


UNWANTED = {
    "estimator": SIMULATOR | {"numba", "mocobot_logs"},
    "mocobot_logs": SIMULATOR | {"numba", "discrepancy", "mocobot"},
    "mocobot_inspect": SIMULATOR | {"numba", "discrepancy", "mocobot"},
    "discrepancy.evidence": SIMULATOR,
}
"""What must not come along with a package, nor with those before it."""


def test_packages_run_without_the_simulator_and_what_is_above_them() -> None:
    """Import all of one package after the other, in one process of their own, and see what came along."""
    own = {package: set(module_files(package)) for package in UNWANTED}
    assert all(own.values())
    code = (
        "import sys, pkgutil, importlib\n"
        f"own = {own!r}\n"
        f"for package, unwanted in {UNWANTED!r}.items():\n"
        "    path = importlib.import_module(package).__path__\n"
        "    for m in pkgutil.walk_packages(path, f'{package}.'): importlib.import_module(m.name)\n"
        "    assert own[package] <= set(sys.modules), own[package] - set(sys.modules)\n"
        "    assert not unwanted & set(sys.modules), (package, unwanted & set(sys.modules))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


OPTIONAL = ("numba", "matplotlib", "PIL", "rerun", "distributed", "dask")
DRAW = ("plots", "picture", "labels")


def test_only_what_draws_or_replays_needs_an_extra() -> None:
    """Everything else can be imported without any of them; numba is asked for by one module, which does without."""
    names = sorted(name for name in module_files() if not name.endswith("__main__"))
    code = (
        f"import importlib, sys\n"
        f"for name in {OPTIONAL!r}: sys.modules[name] = None\n"
        f"for name in {names!r}:\n"
        "    try: importlib.import_module(name)\n"
        "    except ModuleNotFoundError as error: print(name, error.name.split('.')[0])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    needs = dict(line.split() for line in done.stdout.splitlines())
    assert needs
    drawing = {name for name, package in needs.items() if package in ("matplotlib", "PIL")}
    assert all(name.rsplit(".", 1)[-1].startswith(DRAW) for name in drawing), drawing
    replaying = {name for name in set(needs) - drawing if needs[name] == "rerun"}
    assert replaying == {f"mocobot_view.{name}" for name in ("blueprint", "joint_replay", "stream")}
    assert set(needs) == drawing | replaying
