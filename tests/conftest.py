"""Trials that several tests look at, each run once."""

import gc
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path

# Matrices are small here: threads only wait for each other. Before numpy is loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from diagnose_run import BIAS_NM, Edit
from estimator.recording.parquet import write_recording
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth, write_truth
from payload_mjcf import TEAMS


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests first: none of them is then the last, which one process runs while the others wait."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_configure() -> None:
    """Looks for garbage are rare: they took a twentieth of all time and found next to nothing."""
    gc.set_threshold(20_000, 20, 20)


BLANK = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b55"
    "0000000a49444154789c636000000002000148afa4710000000049454e44ae426082"
)
"""A picture of one pixel."""


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Plots are rendered where a test is about them: four seconds a diagnosis. Elsewhere their files are blank."""
    rendered = item.get_closest_marker("pictures") is not None
    FigureCanvasAgg.print_png = RENDER[0] if rendered else _blank
    Figure.savefig = RENDER[1] if rendered else _blank


RENDER = FigureCanvasAgg.print_png, Figure.savefig


def _blank(self: object, path: str | Path, **options: object) -> None:
    Path(path).write_bytes(BLANK)


def pytest_collection_finish() -> None:
    """Modules and tests stay until the end, and are not looked through again."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Where ``SKIPPED_TO`` names a file, it gets the line that ends ``make test``: what was skipped, and why."""
    if path := os.environ.get("SKIPPED_TO"):
        stats = terminalreporter.stats
        kinds = ("passed", "failed", "error", "skipped", "xfailed", "xpassed")
        count = sum(len(stats.get(kind, ())) for kind in kinds)
        reports = stats.get("skipped", ())
        reasons = Counter(str(report.longrepr[2]).removeprefix("Skipped: ") for report in reports)
        told = "; ".join(f"{many} because: {reason}" for reason, many in sorted(reasons.items()))
        Path(path).write_text(
            f"Skipped {len(reports)} of {count} tests{told and ', ' + told}.\n", encoding="utf-8"
        )


@pytest.fixture(scope="session")
def teams(tmp_path_factory) -> dict[int, TeamScene]:
    """Teams of 1, 2 and 5 robots as designed."""
    folder = tmp_path_factory.mktemp("teams")
    return {robots: build_team(payload.write(folder)) for robots, payload in TEAMS.items()}


@pytest.fixture(scope="session")
def team_a() -> TeamScene:
    return build_team("a")


@pytest.fixture(scope="session")
def random_a(team_a) -> TrialLog:
    """Ten random vias with payload (a)."""
    return run_trial(team_a, random_vias(team_a.wrist_home_b, np.random.default_rng(3), vias=10))


@pytest.fixture(scope="session")
def biased_trials(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A random and a periodic trial of payload (b); the torque of robot 2, joint 1 reads too much."""
    folder, rng = tmp_path_factory.mktemp("hidden"), np.random.default_rng(5)
    plain = build_team("b")
    motions = [
        random_vias(plain.wrist_home_b, rng, vias=9),
        sphere_motion(plain.wrist_home_b, plain.X_1i, duration_s=12.0, rng=rng),
    ]
    paths = []
    for k, motion in enumerate(motions):
        scene = apply_effects(build_team("b"), [make_effect("sea_bias", {"bias_Nm": BIAS_NM}, 2, 1)])
        log, path = run_trial(scene, motion, trial_number=k + 1), folder / f"trial{k + 1}.parquet"
        write_recording(measure(log, PRESETS["nominal"], rng, payload="b", name=path.stem), path)
        write_truth(GroundTruth.of(scene), path)
        paths.append(path)
    return paths


@pytest.fixture(scope="session")
def edited(biased_trials: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Edit], str]:
    """Write a changed copy of the first trial."""
    folder = tmp_path_factory.mktemp("edited")

    def write(name: str, edit: Edit) -> str:
        pq.write_table(edit(pq.read_table(biased_trials[0])), folder / name)
        return str(folder / name)

    return write
