"""The paper's experiment end to end: the errors it must reach, the JSON it writes, the tables it prints."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from functools import partial
from pathlib import Path

import pytest

from mocobot.cli import main
from mocobot_sim.paper.experiment import PaperPlan, PaperResult, run_paper
from mocobot_sim.paper.published import published_errors
from mocobot_sim.paper.tables import format_tables

PAYLOADS = ("a", "b", "c", "d")
PAIRS = ("12", "23", "31")
MOMENTS = ("Ixx", "Iyy", "Izz")


LESS = {"vias": 15, "duration_s": 10.0}
"""A sixth of the paper's motion; errors grow by its root, and the bars below do not move."""


@pytest.fixture(scope="module")
def result() -> PaperResult:
    """All payloads and presets: 2 random trials, 1 periodic and 1 static one of each."""
    return run_paper(PaperPlan(trials=2, **LESS), jobs=2)


# Upper bounds of the errors [deg, m, %, m, %], and of the inertia from periodic and from random trials [%].
BARS = {
    "ideal": {"R": 0.001, "p": 2e-5, "m": 0.001, "p1c": 5e-5, "periodic": 0.05, "random": 0.2},
    "nominal": {"R": 0.01, "p": 2e-4, "m": 0.05, "p1c": 1e-3, "periodic": 0.3, "random": 0.5},
}


@pytest.mark.slow
@pytest.mark.parametrize("payload", PAYLOADS)
@pytest.mark.parametrize("preset", BARS)
def test_errors_with_calibrated_robots(result: PaperResult, preset: str, payload: str) -> None:
    bars, score = BARS[preset], result.scores[preset][payload]
    for pair in PAIRS:
        assert score[f"R{pair}_deg"]["mean"] < bars["R"]
        assert score[f"p{pair}_m"]["mean"] < bars["p"]
    assert score["m_percent"] < bars["m"]
    assert score["p1c_m"] < bars["p1c"]
    for kind in ("periodic", "random"):
        for moment in MOMENTS:
            assert score[kind][moment]["percent"] < bars[kind]


@pytest.mark.slow
def test_uncalibrated_errors_are_of_the_papers_order(result: PaperResult) -> None:
    """Root mean square over payloads and rows, per quantity: within a factor of four of the published one."""

    def rms(values: list[float]) -> float:
        return (sum(v * v for v in values) / len(values)) ** 0.5

    def quantities(score: dict) -> dict[str, list[float]]:
        return {
            "R": [score[f"R{pair}_deg"]["mean"] for pair in PAIRS],
            "p": [score[f"p{pair}_percent"]["mean"] for pair in PAIRS],
            "m": [score["m_percent"]],
            "p1c": [score["p1c_percent"]],
            "I": [score["all"][moment]["percent"] for moment in MOMENTS],
        }

    ours = [quantities(result.scores["uncalibrated"][payload]) for payload in PAYLOADS]
    papers = [quantities(published_errors(payload)) for payload in PAYLOADS]
    for name in ours[0]:
        ratio = rms([v for q in ours for v in q[name]]) / rms([v for q in papers for v in q[name]])
        assert 0.25 < ratio < 4.0, (name, ratio)


@pytest.mark.slow
def test_errors_grow_from_preset_to_preset(result: PaperResult) -> None:
    for payload in PAYLOADS:
        ideal, nominal, uncalibrated = (
            result.scores[preset][payload] for preset in ("ideal", "nominal", "uncalibrated")
        )
        for key in ("m_kg", "p1c_m"):
            assert ideal[key] < nominal[key] < uncalibrated[key]


@pytest.mark.slow
def test_trials_stay_within_the_papers_limits(result: PaperResult) -> None:
    assert len(result.trials) == 4 * 2 * (2 + 1 + 1)
    for trial in result.trials:
        assert 3.0 < trial.rotation_deg < 10.0, trial.name
        assert trial.torque_Nm < 20.0, trial.name
        assert trial.rod_error_m < 0.02e-3, trial.name
        assert trial.weld_error_m < 0.01e-3, trial.name
        assert trial.weld_error_deg < 0.001, trial.name


def test_plan_is_the_papers() -> None:
    """Sections IV.C.1 to 3: 6 random trials of 80 vias, 3 periodic ones of 60 s."""
    plan = PaperPlan()
    assert (plan.trials, plan.inertia_trials, plan.vias, plan.duration_s) == (6, 3, 80, 60.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes for one payload and one preset, with as little motion as above."""
    out = tmp_path_factory.mktemp("paper") / "new" / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mocobot.commands.paper.PaperPlan", partial(PaperPlan, **LESS))
        main(["paper", "--payload", "d", "--preset", "nominal", "--trials", "2", "--jobs", "1", "--recordings",
              "--out", str(out)])  # fmt: skip
    return out


@pytest.mark.slow
def test_paper_json(folder: Path) -> None:
    scores = json.loads((folder / "paper.json").read_text())
    assert list(scores) == ["nominal"]
    assert list(scores["nominal"]) == ["d"]
    score = scores["nominal"]["d"]
    grasp_keys = {
        f"{q}{pair}_{unit}" for pair in PAIRS for q, unit in (("R", "deg"), ("p", "m"), ("p", "percent"))
    }
    assert set(score) == grasp_keys | {
        "m_kg",
        "m_percent",
        "p1c_m",
        "p1c_percent",
        "all",
        "random",
        "periodic",
    }
    for key in grasp_keys:
        assert set(score[key]) == {"mean", "std"}
        assert score[key]["mean"] > 0
        assert score[key]["std"] > 0
    for kind in ("all", "random", "periodic"):
        assert set(score[kind]) == set(MOMENTS)
        for moment in MOMENTS:
            assert set(score[kind][moment]) == {"mean", "std", "percent", "std_percent"}


@pytest.mark.slow
def test_everything_else_in_the_folder(folder: Path) -> None:
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    recordings = {
        f"recordings/d_{trial}_nominal{suffix}"
        for trial in ("random0", "random1", "periodic0", "static0")
        for suffix in (".parquet", ".truth.json")
    }
    plots = {"grasps.png", "mass_com.png", "inertia.png"}
    assert (
        names
        == {"paper.json", "tables.txt", "trials.json", "estimates/d_nominal.json", "provenance.json"}
        | plots
        | recordings
    )
    for name in plots:
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    made = json.loads((folder / "provenance.json").read_text())
    assert made["options"] == {
        "payload": ["d"], "preset": ["nominal"], "trials": 2, "seed": 0, "recordings": True,
    }  # fmt: skip
    assert made["files"] == []
    assert {entry["path"] for entry in made["written"]} == names - {"provenance.json"}
    for entry in made["written"]:
        assert entry["sha256"] == hashlib.sha256((folder / entry["path"]).read_bytes()).hexdigest()


@pytest.mark.slow
def test_recordings_give_the_same_estimate_again(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "again.json"
    files = [
        str(folder / "recordings" / f"d_{trial}_nominal.parquet")
        for trial in ("random0", "random1", "static0", "periodic0")
    ]
    main(["estimate", *files, "--out", str(again)])
    first, second = (
        json.loads(path.read_text()) for path in (folder / "estimates" / "d_nominal.json", again)
    )
    assert second["mass"] == first["mass"]
    assert second["com"] == first["com"]
    assert second["inertia"] == first["inertia"]


@pytest.mark.slow
def test_result_does_not_depend_on_jobs_or_on_what_else_runs(folder: Path, result: PaperResult) -> None:
    """One process for one payload and one preset, and two processes for all."""
    scores = json.loads((folder / "paper.json").read_text())
    assert json.loads(json.dumps(result.scores["nominal"]["d"])) == scores["nominal"]["d"]
    # Quantised readings hide a last bit; the extremes of the true trials do not.
    trials = [asdict(trial) for trial in result.trials]
    same_team = [t for t in trials if t["name"].startswith("d ") and t["name"].endswith(" nominal")]
    assert same_team == json.loads((folder / "trials.json").read_text())["trials"]


def test_order_of_the_presets_does_not_matter() -> None:
    """The grasps that construct the later trials come from the least ideal preset, whichever is named last."""
    one, other = (PaperPlan(presets=order).teams() for order in (("nominal", "ideal"), ("ideal", "nominal")))
    assert [[preset.name for preset in team] for team in one] == [["ideal", "nominal"]]
    assert one == other


def test_tables_show_the_published_figures() -> None:
    """Our column filled with the paper's own numbers must repeat them."""
    scores = {"copy": {payload: published_errors(payload) for payload in PAYLOADS}}
    text = format_tables(scores)
    for row in (
        "(a)  R12  0.94 +- 0.21  0.94 +- 0.21",
        "(d)  R12  2.5 +- 0.27   2.5 +- 0.27",
        "(c)  m [kg]   0.11   0.11",
        "     Izz [%]       0.1 +- 4.4      0.1 +- 4.4",
    ):
        assert row in text
    assert text.count("(b)") == 4
