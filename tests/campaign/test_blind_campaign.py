"""Campaigns as they run: plans, files, resumption, refusals, and one from end to end."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command import refused, run
from discrepancy.team.causes import CAUSES
from discrepancy.team.tolerances import default_tolerances
from estimator.errors import InputError
from invented import LIMITS, quiet
from mocobot.campaign import run as command
from mocobot.campaign.effects import Ground, MeasuredLimits, draw_at
from mocobot.campaign.run import CampaignPlan, CampaignStore, run_campaign
from mocobot.campaign.summary import summarise

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


def test_more_sets_begin_with_the_same():
    some, more = PLAN.hidden_sets(), replace(PLAN, sets=9).hidden_sets()
    assert more[:5] == some
    assert len({one.key for one in more}) == 9


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


def test_a_result_of_another_set_is_refused(tmp_path):
    store = CampaignStore(tmp_path / "out", CONFIG)
    first, second = PLAN.clean_sets()
    store.file(first).write_text(json.dumps(quiet((PLAN, second, None))))
    with pytest.raises(InputError, match="not the result of that set"):
        store.get(first)


def test_effects_are_not_sized_without_limits(tmp_path):
    """A clean set that could not be diagnosed says nothing of what can be seen."""

    def breaks(task):
        return {"set": task[1].to_dict(), "error": "broken", "unexpected": True}

    seen = []
    store = CampaignStore(tmp_path / "out", CONFIG)
    run_campaign(PLAN, store, work=lambda task: seen.append(task[2]) or breaks(task))
    assert seen == [None] * 7


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
