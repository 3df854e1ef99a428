"""What an installation without the extras does: the same numbers, no pictures, and a sentence that says so."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from estimator import extras
from invented_calibration import invented_calibration
from mocobot.files.calibrations import write_into
from mocobot_view.camera import Camera
from mocobot_view.render import Shot, render_shots

OPTIONAL = ("numba", "matplotlib", "PIL", "rerun", "distributed", "dask")
BLOCK = f"import sys\nfor name in {OPTIONAL!r}: sys.modules[name] = None\n"
"""An import of a module that is None raises ModuleNotFoundError, as where nothing is installed."""
TRIALS = """
import hashlib, mocobot
digest = hashlib.sha256()
carry = mocobot.simulate("b", "random", vias=1, seed=3)
for values in (carry.log.phi, carry.log.tau, carry.tau): digest.update(values.tobytes())
print(digest.hexdigest(), {compiled} == ("numba" in sys.modules and sys.modules["numba"] is not None))
"""


UNCOMPOSED = "import sys\nsys.modules['dm_control'] = None\n"
"""As on a Python for which labmaze, and so dm-control, has no wheels."""
EVERYTHING = """
import importlib, pkgutil
for name in {packages!r}:
    for module in pkgutil.walk_packages(importlib.import_module(name).__path__, name + "."):
        if not module.name.endswith("__main__"): importlib.import_module(module.name)
"""
COMMAND = "from mocobot.cli import main\nmain(sys.argv[1:])\n"


def without_dm_control(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", UNCOMPOSED + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def test_only_what_composes_a_team_needs_dm_control(tmp_path: Path) -> None:
    src = Path(__file__).resolve().parents[2] / "src"
    packages = sorted(path.parent.name for path in src.glob("*/__init__.py"))
    assert len(packages) == 8
    out = tmp_path / "rec.parquet"
    done = without_dm_control(
        EVERYTHING.format(packages=packages) + COMMAND, "simulate", "--vias", "1", "--out", out
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("mocobot: a team's scene cannot be composed without dm-control (")
    assert done.stderr.endswith("); get it with: pip install --no-deps dm-control\n")
    assert not out.exists()


@pytest.mark.slow
def test_a_diagnosis_without_dm_control_says_what_it_left_out(biased_trials: list[Path]) -> None:
    done = without_dm_control(COMMAND, "diagnose", biased_trials[0], "--laws", "never", "--verbose")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("EXPLAINED: ")
    assert "simulated again" not in done.stdout
    said = " ".join(done.stdout.split())
    assert "The closed loop was not simulated: a team's scene cannot be composed without dm-control (" in said


@pytest.mark.slow
def test_a_trial_has_the_same_bits_without_numba() -> None:
    with_it, without = (
        subprocess.run(
            [sys.executable, "-c", head + TRIALS.format(compiled=compiled)],
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for head, compiled in (("import sys\n", True), (BLOCK, False))
    )  # fmt: skip
    assert with_it == without
    assert with_it[1] == "True"


def test_drives_have_the_same_bits_without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    from mocobot_sim import compiled
    from mocobot_sim.base.drive_kernel import update_drives

    rng = np.random.default_rng(4)
    addresses = [rng.permutation(20)[:8].reshape(2, 4) for _ in range(3)]
    fixed = [rng.standard_normal(20), rng.standard_normal(20)]
    kinematics = [rng.standard_normal((4, 3)), rng.standard_normal((3, 4)), (2.0, 1.5, 4.0, 3.0, 1e-3)]
    plan = [rng.standard_normal((2, 3)), rng.standard_normal((2, 3))]
    changed = [rng.standard_normal(shape) for shape in ((20,), (2, 3), (2, 4), (2, 4), (2, 4))]

    def after(update) -> list[np.ndarray]:
        ctrl, *others = (array.copy() for array in changed)
        update(*fixed, ctrl, *addresses, *kinematics, *plan, *others)
        return [ctrl, *others]

    machine = after(update_drives)
    monkeypatch.setattr(compiled, "njit", None)
    plain = after(compiled.entry(update_drives.py_func))
    for one, other, before in zip(machine, plain, changed, strict=True):
        assert not np.array_equal(one, before)
        np.testing.assert_array_equal(one, other)


@pytest.fixture
def no_plots(monkeypatch: pytest.MonkeyPatch):
    """As where neither matplotlib nor pillow is installed."""
    for name in extras.PLOTS:
        monkeypatch.setitem(sys.modules, name, None)
    extras.draws_plots.cache_clear()
    yield
    extras.draws_plots.cache_clear()


@pytest.mark.usefixtures("no_plots")
def test_a_folder_without_pictures_is_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in (1, 2):
        (tmp_path / f"{number}").mkdir()
        write_into(tmp_path / f"{number}", invented_calibration(seed=number))
    assert capsys.readouterr().err == f"mocobot: {extras.NO_PLOTS}\n"  # once
    names = {path.name for path in (tmp_path / "1").iterdir()}
    assert {"calibration.json", "report.txt", "omnid3.toml"} <= names
    assert not any(name.endswith(".png") for name in names)


def test_a_folder_with_pictures_has_three(tmp_path: Path) -> None:
    write_into(tmp_path, invented_calibration())
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "deviations.png",
        "recordings.png",
        "shares.png",
    }


@pytest.mark.usefixtures("no_plots")
def test_a_page_has_the_sentence_in_place_of_pictures() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    shot = Shot(model, np.zeros(0), Camera((0.0, 0.0, 0.0), 1.0, 0.0, 0.0))
    assert render_shots([shot]) == extras.NO_PLOTS
