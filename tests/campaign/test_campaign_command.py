"""Campaigns: plans, files, resumption, refusals, counts, and one from end to end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from command import refused, run
from discrepancy.team.causes import CAUSES, default_tolerances
from discrepancy.team.diagnosis import diagnose_team
from estimator.errors import InputError
from hidden import LIMITS as TABLE
from hidden import HiddenSet, Schedule, generate
from mocobot.campaign import run as command
from mocobot.campaign.effects import FORCE, Ground, MeasuredLimits, draw_at, push_limits
from mocobot.campaign.run import CampaignPlan, CampaignSet, CampaignStore, run_campaign
from mocobot.campaign.summary import (
    format_campaign,
    interval,
    summarise,
)
from mocobot.plots import save_campaign
from mocobot_report.page import write_report

Json = dict[str, Any]
LIMITS = {
    "places": [
        {"cause": "sea_bias", "kind": "k", "robot": 1, "joint": 1, "parameters": {"bias_Nm": 0.02}},
        {"cause": "sea_bias", "kind": "k", "robot": 1, "joint": 2, "parameters": {"bias_Nm": 0.04}},
        {"cause": "sea_bias", "kind": "k", "robot": 2, "joint": 1, "parameters": {"bias_Nm": None}},
        {"cause": "drag", "kind": "k", "robot": None, "joint": None, "parameters": {"coefficient_Ns_per_m": 0.3}},
    ],
    "pushes": [{"trial": 1, "parameters": {"force_x_N": 0.1, "force_y_N": 0.2, "force_z_N": None}}],
}  # fmt: skip


def named(cause: str, robot: int | None, joint: int | None, probability: float, **values: Any) -> Json:
    """An entry of a diagnosis' causes; values are pairs of estimate and standard error."""
    parameters = {name: {"value": value, "se": se} for name, (value, se) in values.items()}
    return {
        "cause": cause, "family": CAUSES[cause].family, "robot": robot, "joint": joint, "parameters": parameters,
        "alternatives": [], "probability": probability,
    }  # fmt: skip


def result(one: CampaignSet, causes: list[Json], verdict: str = "explained") -> Json:
    """Of a set; what is hidden is a torque zero of 0.08 N m in joint 1 of robot 1, or a drag of 1.2 N s/m."""
    hidden: Json = {"cause": one.cause, "parameters": {"coefficient_Ns_per_m": 1.2}}
    if one.cause == "sea_bias":
        hidden |= {"robot": 1, "joint": 1, "parameters": {"bias_Nm": 0.08}}
    answer = {key: hidden.get(key) for key in ("cause", "robot", "joint")} | {"known": hidden["parameters"]}
    effects = [] if one.cause is None else [hidden | {"answer": answer}]
    out: Json = {
        "set": one.to_dict(), "error": None, "unexpected": False,
        "truth": {"effects": effects, "units": [], "gimbal_axes_1": []},
        "verdict": {"verdict": verdict, "causes": causes, "suspected": [], "scatter": [], "residual": {}, "notes": []},
    }  # fmt: skip
    return out | ({"limits": LIMITS} if one.cause is None else {})


def quiet(task: tuple[CampaignPlan, CampaignSet, Json | None]) -> Json:
    """A diagnosis that never names anything."""
    return result(task[1], [], "consistent")


PLAN = CampaignPlan(background=("calibrated",), causes=("sea_bias", "drag"), teams=2, sets=5)
CONFIG = {"payload": "a"}


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "sets").iterdir()}


def test_every_cause_is_hidden_once_before_any_comes_again():
    plan = CampaignPlan(sets=len(CAUSES) + 3)
    names = [one.cause for one in plan.hidden_sets() if one.background == "calibrated"]
    assert sorted(names[: len(CAUSES)]) == sorted(CAUSES)
    assert len(names) == len(CAUSES) + 3
    uncalibrated = {one.cause for one in plan.hidden_sets() if one.background == "uncalibrated"}
    assert not uncalibrated & {"phi_zero", "theta_zero", "link_length", "sea_scale", "sea_bias"}


def test_effects_are_as_large_as_the_limits_of_their_place_say():
    limits = MeasuredLimits(LIMITS["places"], LIMITS["pushes"])
    ground = Ground(3, np.zeros(3), [(1, 5.0, 30.0)], limits)
    assert limits.where("sea_bias", [1]) == [(1, 1), (1, 2)]  # nothing shows it in robot 2
    effect = draw_at("sea_bias", 3.0, 1, 2, ground, np.random.default_rng(0))
    assert abs(effect.bias_Nm) == pytest.approx(0.12)
    assert limits.where("push", [1]) == []  # along z nothing shows it
    assert limits.where("slosh", [1]) == []


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_can_be_hidden_by_the_limits_of_its_own_parameters(cause):
    """Names in a diagnosis' limits are those that the simulator's effect takes, or that make them up."""
    place = {
        "robot": 2 if CAUSES[cause].per != "payload" else None,
        "joint": 1 if CAUSES[cause].per == "joint" else None,
    }
    sizes = dict.fromkeys(CAUSES[cause].parameters, 1e-4)
    limits = MeasuredLimits(
        [{"cause": cause, **place, "parameters": sizes}],
        [{"trial": 1, "parameters": sizes}] if cause == "push" else [],
    )
    ground = Ground(3, np.zeros(3), [(1, 5.0, 30.0)], limits)
    ((robot, joint),) = limits.where(cause, [1])
    assert (robot, joint) == (place["robot"], place["joint"])
    effect = draw_at(cause, 2.0, robot, joint, ground, np.random.default_rng(1))
    assert effect.cause == cause
    if cause == "payload_mass":  # its limit is that of a drift, in a minute
        assert abs(effect.rate_kgps) == pytest.approx(2e-4 / 60.0)
    elif "tether" not in cause and cause not in ("push", "slosh", "link_length"):
        drawn = [getattr(effect, name) for name in sizes]
        assert np.linalg.norm(drawn) == pytest.approx(2e-4)


def test_an_interrupted_campaign_goes_on_with_the_same_bits(tmp_path):
    done = []

    def stops(task):
        done.append(task[1].key)
        if len(done) == 4:
            raise KeyboardInterrupt
        return quiet(task)

    whole = run_campaign(PLAN, CampaignStore(tmp_path / "whole", CONFIG), work=quiet)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(PLAN, CampaignStore(tmp_path / "cut", CONFIG), work=stops)
    assert len(files(tmp_path / "cut")) == 3
    counted = []
    again = run_campaign(PLAN, CampaignStore(tmp_path / "cut", CONFIG), done=counted.append, work=stops)
    assert again == whole
    assert files(tmp_path / "cut") == files(tmp_path / "whole")
    assert sum(counted) == 7
    assert done[3] == done[4]
    assert len(done) == 8


def test_two_processes_give_the_same_bits(tmp_path):
    run_campaign(PLAN, CampaignStore(tmp_path / "one", CONFIG), 1, work=quiet)
    run_campaign(PLAN, CampaignStore(tmp_path / "two", CONFIG), 2, work=quiet)
    assert len(files(tmp_path / "one")) == 7
    assert files(tmp_path / "two") == files(tmp_path / "one")


def test_another_campaign_is_not_mixed_with_one(tmp_path):
    run_campaign(PLAN, CampaignStore(tmp_path / "out", CONFIG), work=quiet)
    with pytest.raises(InputError, match="holds a campaign with payload a, not b; give --force"):
        CampaignStore(tmp_path / "out", {"payload": "b"})
    assert len(files(tmp_path / "out")) == 7
    CampaignStore(tmp_path / "out", {"payload": "b"}, force=True)
    assert files(tmp_path / "out") == {}


def test_the_command_writes_everything_and_goes_on(tmp_path, monkeypatch, capsys):
    asked = []

    def counted(plan, store, jobs, done, *, remote):
        asked.append(plan.sets)
        return run_campaign(plan, store, jobs, done, remote=remote, work=quiet)

    monkeypatch.setattr(command, "run_campaign", counted)
    out, options = tmp_path / "out", ("--jobs", 1, "--teams", 1, "--causes", "sea_bias", "drag")
    for sets in (2, 3):
        code, text, _ = run(capsys, "campaign", "--out", out, *options, "--sets", sets, "--pictures")
        assert code == 0
        assert "Detection limits" in text
    assert asked == [2, 3]
    assert {path.name for path in out.iterdir()} == {
        "config.json", "sets", "campaign.json", "sets.csv", "report.txt", "provenance.json", "limits.png", "found.png",
        "confusion.png",
    }  # fmt: skip
    assert json.loads((out / "campaign.json").read_text())["sets"]["hidden"] == 6
    said = refused(capsys, "campaign", "--out", out, *options, "--seed", 1)
    assert "holds a campaign with seed 0, not 1" in said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "--out DIR must be given"),
        (("--trials", "random,free"), "it must be a list such as"),
        (("--trials", "static", "--vias", "3"), "--vias"),
        (("--teams", "0"), "--teams is 0; it must be at least 1"),
        (("--sizes", "0"), "must be numbers above 0"),
        (("--calibration", "c.json"), "say with --units"),
        (("--units", "nowhere.json"), "there is no such file"),
        (("--payload", "e"), "'e'"),
        (("--payload", "hinged"), "which has two bodies; a campaign needs a rigid payload"),
        (("--background", "calibrated", "calibrated"), "twice"),
        (("--causes", "sea_baas"), "cause 'sea_baas' does not exist"),
        (("--causes", "drag", "--exclude", "drag"), "both to be hidden and excluded"),
        (("--preset", "uncalibrated"), "--background uncalibrated"),
    ],
)
def test_refusals(options, said, tmp_path, capsys):
    out = ("--out", tmp_path / "out") if options else ()
    assert said in refused(capsys, "campaign", *out, *options)
    assert not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_refused(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    assert "is not a campaign" in refused(capsys, "campaign", "--out", tmp_path)
    assert "is not a campaign" in refused(capsys, "campaign", "--out", tmp_path, "--force")


@pytest.mark.slow
def test_what_is_hidden_is_found_and_a_clean_team_is_clean(tmp_path):
    """From end to end: a team within its tolerances, as it is, and with a torque zero at eight times its limit."""
    few = ("sea_bias", "sea_scale", "phi_zero", "push")  # of a short catalogue, to save time
    plan = CampaignPlan(
        tolerances={cause: default_tolerances()[cause] for cause in few},
        exclude=tuple(cause for cause in CAUSES if cause not in few),
        payload="b", trials="random,periodic", vias=8, duration_s=10.0, background=("calibrated",),
        causes=("sea_bias",), sizes=(8.0,), teams=1, sets=1,
    )  # fmt: skip
    clean, hidden = run_campaign(plan, CampaignStore(tmp_path / "out", CONFIG))
    assert clean["error"] is hidden["error"] is None
    assert clean["verdict"]["causes"] == clean["truth"]["effects"] == []
    limits = MeasuredLimits(clean["limits"]["places"], clean["limits"]["pushes"])
    assert len(limits.where("sea_bias", [1])) == 9
    assert set(limits.at("push", trial=1)) == set(limits.at("push", trial=2))
    assert 0.03 < limits.at("push", trial=1)["force_x_N"] < 1.0
    (effect,) = hidden["truth"]["effects"]
    limit = limits.at("sea_bias", effect["robot"], effect["joint"])["bias_Nm"]
    assert abs(effect["parameters"]["bias_Nm"]) == pytest.approx(8.0 * limit)
    (record,) = [r for r in summarise([clean, hidden])["records"] if r["cause"]]
    assert record["right"]
    assert record["extras"] == []
    assert record["error"] < 0.2


def hidden(number: int, cause: str, factor: float) -> CampaignSet:
    return CampaignSet("calibrated", 1, number, cause, factor)


RIGHT = named("sea_bias", 1, 1, 0.95, bias_Nm=(0.10, 0.01))
ELSEWHERE = named("sea_bias", 2, 1, 0.6, bias_Nm=(0.08, 0.01))
DRAG = named("drag", None, None, 0.8, coefficient_Ns_per_m=(1.2, 0.1))
RESULTS = [
    result(CampaignSet("calibrated", 1), [], "consistent"),
    result(CampaignSet("calibrated", 2), [DRAG]),
    result(hidden(1, "sea_bias", 1.0), [], "consistent"),
    result(hidden(2, "sea_bias", 4.0), [RIGHT]),
    result(hidden(3, "sea_bias", 4.0), [ELSEWHERE]),
    result(hidden(4, "drag", 4.0), [DRAG, RIGHT]),
    {"set": hidden(5, "slosh", 4.0).to_dict(), "error": "unstable", "unexpected": False},
]


@pytest.fixture(scope="module")
def summary():
    return summarise(RESULTS)


def test_brier_score_by_hand(summary):
    """Named: right at 0.95, wrong place at 0.6, right at 0.8 with a stranger at 0.95, a false alarm at 0.8."""
    brier = np.mean([0.05**2, 0.6**2, 0.2**2, 0.95**2, 0.8**2])
    assert summary["reliability"]["number"] == 5
    assert summary["reliability"]["right"] == 2
    assert summary["reliability"]["brier"] == pytest.approx(brier)


@pytest.mark.parametrize(("hits", "of"), [(0, 7), (3, 7), (7, 7), (120, 400)])
def test_interval_is_that_of_scipy(hits, of):
    exact = binomtest(hits, of).proportion_ci(0.95, "exact")
    assert interval(hits, of) == pytest.approx((exact.low, exact.high), abs=1e-9)


def test_what_failed_is_told_and_not_counted(summary):
    assert summary["sets"] == {
        "clean": 2, "hidden": 5, "diagnosed": 6,
        "failed": [{"key": "calibrated-0005-team1-slosh-x4", "error": "unstable", "unexpected": False}],
    }  # fmt: skip
    assert "slosh-x4: unstable" in format_campaign(summary)


@pytest.mark.pictures
def test_pictures(summary, tmp_path):
    names = [path.name for path in save_campaign(summary, tmp_path)]
    assert names == ["limits.png", "found.png", "confusion.png", "reliability.png"]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in names)


def test_page(summary, tmp_path):
    summary = summary | {"records": [{"key": "</script>"}]}
    (tmp_path / "campaign.json").write_text(json.dumps(summary))
    text = write_report(tmp_path).read_text(encoding="utf-8")
    assert "<h1>A blind campaign</h1>" in text
    assert "1 sets were not diagnosed" in text
    assert text.count('class="chart"') == 2
    assert text.count("<table") >= 6
    del summary["limits"]
    (tmp_path / "campaign.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match=r"campaign\.json: not complete \('limits' is missing\)"):
        write_report(tmp_path)


@pytest.mark.slow
def test_a_push_is_noticed_from_the_size_that_the_table_has():
    schedule = Schedule(randoms=1, vias=8, periodic_s=10.0, hold_s=None)
    recordings, _ = generate(HiddenSet("clean", 6, payload="b", schedule=schedule, timestep_s=1e-3))
    found = diagnose_team(recordings, closed_loop=False, laws="never")
    limits = push_limits(found.outcome, default_tolerances()["push"])
    assert [limit["trial"] for limit in limits] == [1, 2]
    for limit in limits:
        for name in FORCE:
            assert limit["parameters"][name] == pytest.approx(TABLE["push"][name], rel=0.5)
