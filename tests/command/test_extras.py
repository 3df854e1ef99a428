"""What needs an extra: pictures, compiled code, a cluster; and runs that go on where they were interrupted."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from command import refused
from estimator import extras
from invented_calibration import invented_calibration
from mocobot.api.calibration import Calibration
from mocobot.checks import PARTIAL, check_paper
from mocobot.options import Paper
from mocobot.results import public
from mocobot_sim.paper import experiment
from mocobot_sim.paper.experiment import PaperPlan, run_paper
from mocobot_sim.paper.store import FOLDER, Store
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


def test_only_what_composes_a_team_needs_dm_control(tmp_path):
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
def test_a_diagnosis_without_dm_control_says_what_it_left_out(biased_trials):
    done = without_dm_control(COMMAND, "diagnose", biased_trials[0], "--laws", "never", "--verbose")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("EXPLAINED: ")
    assert "simulated again" not in done.stdout
    said = " ".join(done.stdout.split())
    assert "The closed loop was not simulated: a team's scene cannot be composed without dm-control (" in said


@pytest.mark.slow
def test_a_trial_has_the_same_bits_without_numba():
    with_it, without = (
        subprocess.run(
            [sys.executable, "-c", head + TRIALS.format(compiled=compiled)],
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for head, compiled in (("import sys\n", True), (BLOCK, False))
    )  # fmt: skip
    assert with_it == without
    assert with_it[1] == "True"


def test_drives_have_the_same_bits_without_numba(monkeypatch):
    from mocobot_sim import kernels
    from mocobot_sim.kernels import update_drives

    rng = np.random.default_rng(4)
    addresses = [rng.permutation(20)[:8].reshape(2, 4) for _ in range(3)]
    fixed = [rng.standard_normal(20), rng.standard_normal(20)]
    kinematics = [rng.standard_normal((2, 4, 3)), rng.standard_normal((2, 3, 4)), (2.0, 1.5, 4.0, 3.0, 1e-3)]
    plan = [rng.standard_normal((2, 3)), rng.standard_normal((2, 3))]
    changed = [rng.standard_normal(shape) for shape in ((20,), (2, 3), (2, 4), (2, 4), (2, 4))]

    def after(update) -> list[np.ndarray]:
        ctrl, *others = (array.copy() for array in changed)
        update(*fixed, ctrl, *addresses, *kinematics, *plan, *others)
        return [ctrl, *others]

    machine = after(update_drives)
    monkeypatch.setattr(kernels, "njit", None)
    plain = after(kernels.entry(update_drives.py_func))
    for one, other, before in zip(machine, plain, changed, strict=True):
        assert not np.array_equal(one, before)
        np.testing.assert_array_equal(one, other)


@pytest.fixture
def no_plots(monkeypatch):
    """As where neither matplotlib nor pillow is installed."""
    for name in extras.PLOTS:
        monkeypatch.setitem(sys.modules, name, None)
    extras.draws_plots.cache_clear()
    yield
    extras.draws_plots.cache_clear()


@pytest.mark.usefixtures("no_plots")
def test_a_folder_without_pictures_is_whole(tmp_path, capsys):
    for number in (1, 2):
        (tmp_path / f"{number}").mkdir()
        public(Calibration, invented_calibration(seed=number)).write_into(tmp_path / f"{number}")
    assert capsys.readouterr().err == f"mocobot: {extras.NO_PLOTS}\n"  # once
    names = {path.name for path in (tmp_path / "1").iterdir()}
    assert {"calibration.json", "report.txt", "omnid3.toml"} <= names
    assert not any(name.endswith(".png") for name in names)


def test_a_folder_with_pictures_has_three(tmp_path):
    public(Calibration, invented_calibration()).write_into(tmp_path)
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "deviations.png",
        "recordings.png",
        "shares.png",
    }


@pytest.mark.usefixtures("no_plots")
def test_a_page_has_the_sentence_in_place_of_pictures():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    shot = Shot(model, np.zeros(0), Camera((0.0, 0.0, 0.0), 1.0, 0.0, 0.0))
    assert render_shots([shot]) == extras.NO_PLOTS


PLAN = PaperPlan(payloads=("b",), presets=("ideal",), trials=2, vias=6, duration_s=5.0, staged_only=True)

CLUSTER = """
import json, os, signal, sys, threading, time
from pathlib import Path

from distributed import Client, LocalCluster
from joblib import Parallel, delayed

from mocobot.cluster import workers_of
from mocobot_sim.paper import experiment
from mocobot_sim.paper.experiment import PaperPlan, run_paper
from mocobot_sim.paper.store import Store


def not_here(*_, **__):
    raise RuntimeError("this is no worker")


def main(out):
    experiment.simulate = experiment.estimate_grasps = experiment.estimate_payload = not_here
    plan = PaperPlan(payloads=("b",), presets=("ideal",), trials=2, vias=6, duration_s=5.0, staged_only=True)
    store, killed = Store(out, "key", force=False), []
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            pids = client.run(os.getpid)

            def busy():
                return [name for name, tasks in client.processing().items() if tasks]

            def kill():
                while not (names := busy()):
                    time.sleep(0.05)
                time.sleep(0.3)
                os.kill(pids[names[0]], signal.SIGKILL)
                killed.append(names[0])

            killer = threading.Thread(target=kill)
            killer.start()
            with workers_of(cluster.scheduler_address):
                result = run_paper(plan, 1, None, store, remote=True)
                list(Parallel()(delayed(len)(bytes(20_000_000 + i)) for i in range(2)))  # as large as recordings
            killer.join()
    assert os.getpid() not in pids.values()
    print(json.dumps({"killed": len(killed), "scores": result.scores}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def reference() -> str:
    """The scores of one process, uninterrupted, all digits."""
    return json.dumps(run_paper(PLAN).scores)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_same_bits(tmp_path, reference):
    """Two workers in processes of their own, one of them killed while it has something to do."""
    script, out = tmp_path / "script.py", tmp_path / "out"
    script.write_text(CLUSTER)
    done = subprocess.run(
        [sys.executable, str(script), str(out)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "large graph" not in done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["killed"] == 1
    assert json.dumps(said["scores"]) == reference
    assert len(list((out / FOLDER / "key").iterdir())) == PLAN.steps


@pytest.mark.slow
def test_an_interrupted_run_goes_on_with_the_same_bits(tmp_path, reference, monkeypatch):
    """What was done is not done again."""
    simulated: list[str] = []
    simulate = experiment.simulate

    def counted(request, *arguments, **options):
        simulated.append(request.trial)
        if len(simulated) == 4:
            raise KeyboardInterrupt
        return simulate(request, *arguments, **options)

    monkeypatch.setattr(experiment, "simulate", counted)
    with pytest.raises(KeyboardInterrupt):
        run_paper(PLAN, store=Store(tmp_path, "key", force=False))
    kept = {path.name for path in (tmp_path / FOLDER / "key").iterdir()}
    assert kept == {
        "random-trials-0.npz",
        "random-trials-1.npz",
        "grasps-0.npz",
        "other-trials-0.npz",
    }
    result = run_paper(PLAN, store=(store := Store(tmp_path, "key", force=False)))
    assert json.dumps(result.scores) == reference
    assert len(simulated) == 5, "trials were simulated again"
    store.drop()
    assert list(tmp_path.iterdir()) == []


def test_parts_of_another_run_are_kept_unless_told(tmp_path):
    Store(tmp_path, "one", force=False).put("stage", 0, 1.5)
    with pytest.raises(experiment.InputError, match="holds parts of an interrupted run with other options"):
        Store(tmp_path, "two", force=False)
    assert Store(tmp_path, "one", force=False).get("stage", 0) == 1.5
    assert not Store(tmp_path, "two", force=True).has("stage", 0)
    assert [path.name for path in (tmp_path / PARTIAL).iterdir()] == ["two"]
    assert PARTIAL == FOLDER


def test_a_run_killed_while_it_writes_its_results_goes_on_without_force(tmp_path):
    """A whole experiment, and somebody's folder of another kind, need more than that."""
    out = tmp_path / "out"
    Store(out, "key", force=False).put("stage", 0, 1.5)
    check_paper(Paper(out=out))
    (out / "paper.json").write_text("{}")
    check_paper(Paper(out=out))
    Store(out, "key", force=False).drop()
    with pytest.raises(experiment.InputError, match="is an earlier experiment; give --force"):
        check_paper(Paper(out=out))
    (out / PARTIAL).mkdir()
    (out / "paper.json").rename(out / "mine.json")
    with pytest.raises(experiment.InputError, match="exists and is not an earlier experiment"):
        check_paper(Paper(out=out))


@pytest.mark.parametrize(
    ("scheduler", "sentence"),
    [
        ("tcp://127.0.0.1:1", "scheduler tcp://127.0.0.1:1: cannot be reached ("),
        (
            "cluster",
            "--scheduler is 'cluster'; it must be an address such as tcp://host:8786, or a scheduler file",
        ),
    ],
)
def test_no_scheduler(tmp_path, capsys, monkeypatch, scheduler, sentence):
    monkeypatch.setattr("mocobot.cluster.REACH_S", 0.5)
    monkeypatch.chdir(tmp_path)
    assert sentence in refused(capsys, "paper", "--scheduler", scheduler)


def test_without_dask(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert refused(capsys, "paper", "--scheduler", "tcp://127.0.0.1:1") == (
        "mocobot: --scheduler needs dask.distributed, which is not installed; get it with: pip install "
        "'mocobot[cluster]'"
    )
