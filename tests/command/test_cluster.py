"""Work on other processes' terms: a cluster whose worker dies, and a run that goes on where it was interrupted."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from command import refused
from mocobot.checks import PARTIAL, check_paper
from mocobot.options import Paper
from mocobot_sim.paper import experiment
from mocobot_sim.paper.experiment import PaperPlan, run_paper
from mocobot_sim.paper.store import FOLDER, Store

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
def test_a_cluster_that_loses_a_worker_gives_the_same_bits(tmp_path: Path, reference: str) -> None:
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
def test_an_interrupted_run_goes_on_with_the_same_bits(
    tmp_path: Path, reference: str, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_parts_of_another_run_are_kept_unless_told(tmp_path: Path) -> None:
    Store(tmp_path, "one", force=False).put("stage", 0, 1.5)
    with pytest.raises(experiment.InputError, match="holds parts of an interrupted run with other options"):
        Store(tmp_path, "two", force=False)
    assert Store(tmp_path, "one", force=False).get("stage", 0) == 1.5
    assert not Store(tmp_path, "two", force=True).has("stage", 0)
    assert [path.name for path in (tmp_path / PARTIAL).iterdir()] == ["two"]
    assert PARTIAL == FOLDER


def test_a_run_killed_while_it_writes_its_results_goes_on_without_force(tmp_path: Path) -> None:
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
def test_no_scheduler(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    scheduler: str,
    sentence: str,
) -> None:
    monkeypatch.setattr("mocobot.cluster.REACH_S", 0.5)
    monkeypatch.chdir(tmp_path)
    assert sentence in refused(capsys, "paper", "--scheduler", scheduler)


def test_without_dask(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert refused(capsys, "paper", "--scheduler", "tcp://127.0.0.1:1") == (
        "mocobot: --scheduler needs dask.distributed, which is not installed; get it with: pip install "
        "'mocobot[cluster]'"
    )
