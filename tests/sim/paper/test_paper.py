"""The paper's experiment end to end: errors, files, tables, progress, and outcomes of an interrupted run."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace as Namespace
from typing import Any

import numpy as np
import pytest
from joblib import Parallel, delayed

from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedTrial, Calibration
from estimator.calibrate.json import calibration_from_dict
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.leftover import Leftover
from estimator.estimate.result import PayloadEstimate, RecordingEstimate
from estimator.estimate.statics import MassEstimate
from estimator.estimate.uncertainty import StepReport, WeakDirection
from estimator.rigid_team import Bases
from mocobot.cli import main
from mocobot_sim.paper import experiment
from mocobot_sim.paper import store as shares_module
from mocobot_sim.paper.experiment import (
    ONE_FIT,
    SELF_CALIBRATED,
    TRANSFER,
    PaperPlan,
    PaperResult,
    TrialSummary,
    fit_trials,
    run_paper,
    three_trials,
)
from mocobot_sim.paper.scoring import payload_truth, published_errors, score_fit
from mocobot_sim.paper.store import Store, shares
from mocobot_sim.paper.tables import BY_ENCODERS, format_tables, summary_table
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.sensors import SensorPreset, measure, sensor_preset
from mocobot_sim.trial.simulate import Simulated, TrialRequest, draw_units
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth
from recordings import metadata, small_recording

PAYLOADS = ("a", "b", "c", "d")
PAIRS = ("12", "23", "31")
MOMENTS = ("Ixx", "Iyy", "Izz")


LESS = {"vias": 8, "duration_s": 6.0}
"""A tenth of the paper's motion; errors grow by its root, and the bars below do not move."""


@pytest.fixture(scope="module")
def result() -> PaperResult:
    """All payloads and presets: 2 random trials, 1 periodic and 1 static one of each; no fits beside the stages."""
    return run_paper(PaperPlan(trials=2, staged_only=True, **LESS), jobs=2)


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


@pytest.fixture(scope="module")
def calibrated(result: PaperResult) -> Calibration:
    """Robots and payload (a) from three of its recordings."""
    return fit_trials(three_trials(result.recordings["uncalibrated"]["a"]), "uncalibrated")


def check_calibrated(found: Calibration, payload: str) -> None:
    """Errors in the frames that the encoders define, absolute ones and in multiples of what the fit claims."""
    units = draw_units(payload, sensor_preset("uncalibrated"), 0)
    errors = score_fit(found.payloads[0], payload_truth(payload), units)
    seen = errors["encoder_frames"]
    for pair in PAIRS:
        assert seen[f"R{pair}_deg"]["mean"] < 0.004
        assert seen[f"p{pair}_m"]["mean"] < 8e-4
        assert errors[f"R{pair}_deg"]["mean"] > 0.1, "theta_x zeros of about 1 deg"
    assert seen["p1c_m"] < 5e-4
    scale = errors["spring_scale"]
    assert max(scale[f"{name}_percent"] for name in ("m", *MOMENTS)) < 0.3
    claimed = found.payloads[0].covariance[12, 12] ** 0.5
    mass = payload_truth(payload).mass * (1.0 + scale["percent"] / 100.0)
    assert abs(found.payloads[0].parameters[0] - mass) < 4.0 * claimed
    assert claimed < 2e-3 * mass


@pytest.mark.slow
def test_uncalibrated_team_calibrates_itself(calibrated: Calibration) -> None:
    assert [trial.kind for trial in calibrated.trials] == ["random", "static", "periodic"]
    check_calibrated(calibrated, "a")


@pytest.mark.slow
def test_calibration_serves_another_payload(result: PaperResult, calibrated: Calibration) -> None:
    """The robots of a seed are the same with every payload."""
    recordings = three_trials(result.recordings["uncalibrated"]["b"])
    found = fit_trials(recordings, "uncalibrated", calibrated)
    np.testing.assert_array_equal(found.units.x, calibrated.units.x)
    check_calibrated(found, "b")


def test_robots_of_a_seed_carry_every_payload() -> None:
    units = [[u.to_dict() for u in draw_units(p, sensor_preset("uncalibrated"), 3)] for p in PAYLOADS]
    assert units[0] == units[1] == units[2] == units[3]
    assert units[0] != [u.to_dict() for u in draw_units("a", sensor_preset("uncalibrated"), 4)]


@pytest.mark.slow
def test_trials_stay_within_the_papers_limits(result: PaperResult) -> None:
    assert len(result.trials) == 4 * 3 * (2 + 1 + 1)
    for trial in result.trials:
        assert 3.0 < trial.rotation_deg < 10.0, trial.name
        assert trial.torque_Nm < 20.0, trial.name
        assert trial.rod_error_m < 0.02e-3, trial.name
        assert trial.weld_error_m < 0.01e-3, trial.name
        assert trial.weld_error_deg < 0.001, trial.name
        assert trial.damping_ratio > 0.2, trial.name


def test_plan_is_the_papers() -> None:
    """Sections IV.C.1 to 3: 6 random trials of 80 vias, 3 periodic ones of 60 s."""
    plan = PaperPlan()
    assert (plan.trials, plan.inertia_trials, plan.vias, plan.duration_s) == (6, 3, 80, 60.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes for one payload and one preset, with as little motion as above."""
    out = tmp_path_factory.mktemp("paper") / "new" / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mocobot.api.paper.PaperPlan", partial(PaperPlan, **LESS))
        main(["paper", "--payload", "d", "--preset", "nominal", "--trials", "2", "--jobs", "1", "--recordings",
              "--out", str(out)])  # fmt: skip
    return out


@pytest.mark.slow
@pytest.mark.pictures
def test_paper_json(folder: Path) -> None:
    scores = json.loads((folder / "paper.json").read_text())
    assert list(scores) == ["nominal", "nominal, one fit"]
    assert list(scores["nominal"]) == list(scores["nominal, one fit"]) == ["d"]
    fitted = scores["nominal, one fit"]["d"]
    assert set(fitted) == set(scores["nominal"]["d"]) - {"random", "periodic"} | {"spring_scale"}
    bars = BARS["nominal"]
    for pair in PAIRS:
        assert fitted[f"R{pair}_deg"]["mean"] < bars["R"] / 4
        assert fitted[f"p{pair}_m"] == {"mean": pytest.approx(0, abs=bars["p"] / 4), "std": None}
    assert fitted["p1c_m"] < bars["p1c"] / 4
    assert fitted["m_percent"] < bars["m"] / 4
    assert fitted["spring_scale"]["percent"] == 0.0
    for moment in MOMENTS:
        assert fitted["all"][moment]["percent"] < bars["periodic"] / 2
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
        "encoder_frames",
    }
    # Nominal robots' encoders define the CAD's frames.
    assert score["encoder_frames"] == {
        key: score[key] for key in score["encoder_frames"].keys() | grasp_keys | {"p1c_m", "p1c_percent"}
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
        | {"fits/d_nominal_one_fit.json"}
        | plots
        | recordings
    )
    fitted = calibration_from_dict(json.loads((folder / "fits" / "d_nominal_one_fit.json").read_text()))
    assert [trial.kind for trial in fitted.trials] == ["random", "static", "periodic"]
    assert fitted.payloads[0].parameters[0] == pytest.approx(payload_truth("d").mass, rel=1e-4)
    for name in plots:
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    made = json.loads((folder / "provenance.json").read_text())
    assert made["options"] == {
        "payload": ["d"], "preset": ["nominal"], "trials": 2, "seed": 0, "recordings": True,
        "staged_only": False,
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
    first = json.loads((folder / "estimates" / "d_nominal.json").read_text())
    main(["estimate", *files, "--method", first["method"], "--out", str(again)])
    second = json.loads(again.read_text())
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


def fitted_scores() -> dict:
    """A preset and its fits: published errors, a tenth in the encoders' frames; (a) calibrated the robots for (b)."""

    def entry(payload: str, share: float) -> dict:
        errors = published_errors(payload)
        seen = {key: value for key, value in errors.items() if key[0] in "Rp"}
        for key, value in seen.items():
            seen[key] = {"mean": value["mean"] / 10, "std": None} if isinstance(value, dict) else value / 10
        scale = {"percent": share} | {f"{name}_percent": 0.02 for name in ("m", *MOMENTS)}
        return errors | {"encoder_frames": seen, "spring_scale": scale}

    fits = {p: entry(p, -0.64) for p in "ab"}
    staged = {p: {key: v for key, v in entry(p, 0.0).items() if key != "spring_scale"} for p in "ab"}
    return {"uncalibrated": staged, SELF_CALIBRATED: fits, TRANSFER: {"a": None, "b": fits["b"]}}


def test_tables_show_both_frames_and_what_a_fit_has_not() -> None:
    text = format_tables(fitted_scores())
    for row in (
        "                           paper         uncalibrated  uncalibrated,    uncalibrated,",
        "                                                       self-calibrated  transfer",
        "(a)  R12                  0.94 +- 0.21  0.94 +- 0.21  0.94 +- 0.21     none",
        "     R12, encoder frames  none          0.094         0.094            none",
        "(b)  R12                  1.8 +- 0.19   1.8 +- 0.19   1.8 +- 0.19      1.8 +- 0.19",
        "     p1c [m], encoder frames  none   0.0018        0.0018           0.0018",
    ):
        assert row.strip() in text, text
    assert "here -0.64 %," in text.replace("\n", " ")
    summary = summary_table(fitted_scores())
    (row,) = summary.part("mm", "centre of mass", BY_ENCODERS).rows
    assert [cell.value for cell in row.cells] == [None, *(pytest.approx(v) for v in (2.1, 2.1, 1.8))]
    assert "beyond that they err by at most 0.02 %" in summary.note


def test_fits_stand_beside_their_presets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three trials each; the first payload calibrates the robots for the others; columns in the presets' order."""
    plan = PaperPlan(("c", "a"), ("uncalibrated", "ideal", "nominal"), trials=2)
    assert plan.fits() == [
        (column, preset, payload)
        for preset, column in (("uncalibrated", SELF_CALIBRATED), ("nominal", ONE_FIT))
        for payload in ("c", "a")
    ]
    assert plan.transfers() == [(TRANSFER, "uncalibrated", "a")]
    alone = replace(plan, staged_only=True)
    assert (alone.fits(), alone.transfers()) == ([], [])
    assert plan.steps - alone.steps == 5

    def simulate(
        request: TrialRequest, presets: Sequence[SensorPreset], *_: object, **__: object
    ) -> Namespace:
        recording = Namespace(
            metadata=Namespace(trial=request.trial), name=f"{request.payload}{request.number}"
        )
        log = Namespace(
            stability=Namespace(damping_ratio=0.4),
            payload_rotation=lambda: np.zeros((1, 3)), tau=np.zeros(1), rod_error_m=0.0, weld_error_m=0.0,
            weld_error_rad=0.0,
        )  # fmt: skip
        return Namespace(recordings={preset.name: recording for preset in presets}, log=log)

    def fit(recordings: list, preset: str, robots: Namespace | None, start: list) -> Namespace:
        assert start == recordings
        assert [r.metadata.trial for r in recordings] == ["random", "static", "periodic"]
        assert {r.name[1:] for r in recordings} == {"0"}
        return Namespace(payloads=[(recordings[0].name, preset, robots and robots.payloads[0])])

    for name, does in (("simulate", simulate), ("fit_trials", fit), ("_grasps", lambda *_: None),
                       ("estimate_both", lambda of, fitted: (None, three_trials(of) if fitted else None)),
                       ("score", lambda *_: {}),
                       ("score_fit", lambda found, truth, units: (found, truth.name, len(units)))):  # fmt: skip
        monkeypatch.setattr(experiment, name, does)
    told: list[tuple[float, float, str]] = []
    result = run_paper(plan, progress=lambda *now: told.append(now))
    own = ("c0", "uncalibrated", None)
    assert list(result.scores) == ["uncalibrated", SELF_CALIBRATED, TRANSFER, "ideal", "nominal", ONE_FIT]
    assert result.scores[SELF_CALIBRATED] == {"c": (own, "c", 3), "a": (("a0", "uncalibrated", None), "a", 3)}
    assert result.scores[TRANSFER] == {"c": None, "a": (("a0", "uncalibrated", own), "a", 3)}
    assert result.scores[ONE_FIT]["a"] == (("a0", "nominal", None), "a", 0)
    stages = list(dict.fromkeys(stage for _, _, stage in told))
    assert stages == ["random trials", "grasps", "other trials", "estimates", "calibrations", "transfer"]
    assert told[-1][:2] == (plan.steps, plan.steps)


def _work(share: Array, amount: float) -> None:
    share[0] = amount


@pytest.mark.slow
def test_other_processes_fill_shares() -> None:
    told: list[float] = []
    with shares(3, told.append) as done, Parallel(n_jobs=2) as pool:
        assert set(told) == {0.0}
        pool(delayed(_work)(done[k : k + 1], amount) for k, amount in enumerate((0.25, 0.5, 1.0)))
    assert told[-1] == 1.75


def test_parts_of_trials_count(
    monkeypatch: pytest.MonkeyPatch, random_a: TrialLog, team_a: TeamScene
) -> None:
    """Trials that take four looks each, one of which is the end."""
    looks = 0.02
    monkeypatch.setattr(shares_module, "EVERY_S", looks)
    recording = measure(random_a, sensor_preset("ideal"), np.random.default_rng(0), name="rec")

    def simulate(*_: object, progress: Callable[[int, int], object], **__: object) -> Simulated:
        for quarter in range(5):
            progress(100 * quarter, 400)
            time.sleep(3.0 * looks)
        return Simulated({"ideal": recording}, random_a, GroundTruth.of(team_a))

    monkeypatch.setattr(experiment, "simulate", simulate)
    monkeypatch.setattr(experiment, "estimate_both", lambda *_: (None, None))
    monkeypatch.setattr(experiment, "score", lambda *_: {})
    plan = PaperPlan(payloads=("a",), presets=("ideal",), trials=2)
    told: list[tuple[float, float, str]] = []
    run_paper(plan, progress=lambda *now: told.append(now))
    done = [now for now, _, _ in told]
    assert done == sorted(done)
    assert (done[0], done[-1]) == (0.0, plan.steps)
    assert {steps for _, steps, _ in told} == {plan.steps}
    stages = list(dict.fromkeys(stage for _, _, stage in told))
    assert stages == ["random trials", "grasps", "other trials", "estimates"]
    assert {0.25, 0.5, 0.75, 1.25, 3.5} < set(done)


def same(a: Any, b: Any) -> bool:
    """Whether two outcomes are alike, bit by bit."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes("A") == b.tobytes("A")
    if is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple | list):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and (a == b or (a != a and b != b))


def outcomes() -> list[Any]:
    rng = np.random.default_rng(1)
    recording = small_recording(rows=600)
    units = ArmUnit(metadata().design, rng.standard_normal((3, COUNT)))
    bases = Bases(np.asfortranarray(rng.standard_normal((3, 3))), rng.standard_normal((3, 3)))
    trial = CalibratedTrial(
        "b", "static", 0, 1.5, (3, 4), None, (0.1, np.inf), (np.nan, 1e-300), bases, {"tilt": 0.1}
    )
    calibration = Calibration(
        units, rng.standard_normal((9, 9)), rng.standard_normal((3, COUNT)), 0.0, Prior(), (), (trial,), ("a",), 4, (),
        ("x",),
    )  # fmt: skip
    weak = WeakDirection("mass", "m", (0.1, 0.2), "why")
    estimate = PayloadEstimate(
        None, 3, "staged", None, MassEstimate(np.float64(0.1) * 3, 0.2, 0.3), rng.standard_normal(3), None, None,
        (StepReport("mass", ("m",), "kg", (1.0, 0.0), 0.1, (weak,)),),
        (RecordingEstimate("a", "static", 1.0, 2, leftovers=(Leftover("force", "N", 0.1, 0.2),)),), ("flag",),
    )  # fmt: skip
    return [
        1.5, None, (rng.standard_normal((2, 3)), np.zeros((2, 3, 3), order="F")),
        ({"ideal": recording}, TrialSummary("a", 0.1, 0.2, 1e-17, 0.3, -0.0, None)), calibration,
        (estimate, None),
    ]  # fmt: skip


def test_every_bit_comes_back(tmp_path: Path) -> None:
    store = Store(tmp_path, "key", force=False)
    for k, outcome in enumerate(outcomes()):
        store.put("some stage", k, outcome)
        assert store.has("some stage", k)
        assert same(Store(tmp_path, "key", force=False).get("some stage", k), outcome), outcome


class Evil:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.path,))


def spoiled(folder: Path) -> dict[str, bytes]:
    evil, inside = pickle.dumps(Evil(folder / "executed")), io.BytesIO()
    np.savez(inside, facts=np.array([Evil(folder / "executed")], dtype=object))
    other, packed = io.BytesIO(), io.BytesIO()
    np.savez(other, facts=np.frombuffer(b'{"Popen": {"args": "true"}}', np.uint8))
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("facts.npy", bytes(1000))
    return {
        "a pickle": evil, "a pickle in an array": inside.getvalue(), "another class": other.getvalue(),
        "an unlimited packing": packed.getvalue(), "nothing": b"",
    }  # fmt: skip


@pytest.mark.parametrize(
    "what", ["a pickle", "a pickle in an array", "another class", "an unlimited packing", "nothing"]
)
def test_a_file_of_somebody_else_is_refused(tmp_path: Path, what: str) -> None:
    store = Store(tmp_path / "out", "key", force=False)
    store.put("stage", 0, 1.5)
    (file,) = store.folder.iterdir()
    file.write_bytes(spoiled(tmp_path)[what])
    with pytest.raises(InputError) as caught:
        store.get("stage", 0)
    assert str(caught.value).startswith(f"{file}: ")
    assert ("is not packed as numpy does it" in str(caught.value)) == (what == "an unlimited packing")
    assert not (tmp_path / "executed").exists()
