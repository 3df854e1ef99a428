"""What a campaign counts, against counts by hand and scipy's own intervals."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from scipy.stats import binomtest

from estimator.errors import InputError
from invented import named, result
from mocobot.campaign.run import CampaignPlan, CampaignSet
from mocobot.campaign.summary import (
    COLUMNS,
    csv_table,
    format_campaign,
    interval,
    match,
    reliability,
    summarise,
)
from mocobot.plots import save_campaign
from mocobot_report.page import write_report


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


def test_found_by_size(summary):
    small, large = summary["found"]
    assert (small["factor"], large["factor"]) == (1.0, 4.0)
    assert [(small[k]["hits"], small[k]["of"]) for k in ("right", "cause", "missed")] == [
        (0, 1),
        (0, 1),
        (1, 1),
    ]
    counts = [(large[k]["hits"], large[k]["of"]) for k in ("right", "cause", "missed", "extras")]
    assert counts == [(2, 3), (3, 3), (0, 3), (1, 3)]


def test_confusion_says_what_was_taken_for_what(summary):
    found = summary["confusion"]
    assert found["hidden"] == ["sea_bias", "drag"]
    table = {
        (row, column): n
        for row, counts in zip(found["hidden"], found["counts"], strict=True)
        for column, n in zip(found["named"], counts, strict=True)
        if n
    }
    assert table == {("sea_bias", "sea_bias"): 2, ("sea_bias", "nothing"): 1, ("drag", "drag"): 1}


def test_false_alarms_are_of_clean_sets_alone(summary):
    (alarms,) = summary["false_alarms"]
    assert (alarms["alarms"]["hits"], alarms["alarms"]["of"]) == (1, 2)
    assert alarms["named"] == {"drag": 1}
    assert alarms["verdicts"] == {"consistent": 1, "explained": 1}


def test_errors_are_of_what_was_found_where_it_was(summary):
    bias = next(entry for entry in summary["causes"] if entry["cause"] == "sea_bias")
    assert bias["error"] == pytest.approx(0.25)
    assert bias["over_se"] == pytest.approx(2.0)


@pytest.mark.parametrize(("hidden_s", "deviations"), [(0.0, (2.0,)), (0.02, (2.0, -1.0))])
def test_what_a_simulation_has_of_its_own_is_no_error(hidden_s, deviations):
    """A spring that is told to follow at once follows as its mass lets it: 10 ms is right, if 20 were not said."""
    known = {"compliance_m_per_N": 1e-5, "relaxation_s": hidden_s}
    item = named("grasp_flex", 1, None, 0.9, compliance_m_per_N=(1.2e-5, 1e-6), relaxation_s=(0.01, 0.01))
    answer = {"cause": "grasp_flex", "robot": 1, "joint": None, "known": known}
    truth = {"effects": [{"cause": "grasp_flex", "parameters": known, "answer": answer}], "gimbal_axes_1": []}
    (score,) = match([item], truth, [4.0]).scores
    assert score.right
    assert score.deviations == pytest.approx(deviations)


@pytest.mark.parametrize(
    ("hidden_kg", "named_kg", "deviations"),
    [(0.0, (70.0, 5.0), ()), (71.0, (70.0, 5.0), (-0.2,)), (71.0, (0.0, None), ())],
)
def test_the_mass_on_a_base_that_gives_way_counts_where_both_say_it(hidden_kg, named_kg, deviations):
    """Less than the robot's own is not what moves; and none is said where none shows."""
    known = {"compliance_m_per_N": 1e-5, "relaxation_s": 0.0, "mass_kg": hidden_kg}
    item = named("base_compliance", 1, None, 0.9, compliance_m_per_N=(1.2e-5, 1e-6), mass_kg=named_kg)
    answer = {"cause": "base_compliance", "robot": 1, "joint": None, "known": known}
    truth = {
        "effects": [{"cause": "base_compliance", "parameters": known, "answer": answer}],
        "gimbal_axes_1": [],
    }
    (score,) = match([item], truth, [4.0]).scores
    assert score.right
    assert score.deviations == pytest.approx((2.0, *deviations))


def test_brier_score_by_hand(summary):
    """Named: right at 0.95, wrong place at 0.6, right at 0.8 with a stranger at 0.95, a false alarm at 0.8."""
    brier = np.mean([0.05**2, 0.6**2, 0.2**2, 0.95**2, 0.8**2])
    assert summary["reliability"]["number"] == 5
    assert summary["reliability"]["right"] == 2
    assert summary["reliability"]["brier"] == pytest.approx(brier)


def test_reliability_of_a_generator_that_is_right_as_often_as_it_says():
    rng = np.random.default_rng(0)
    p = rng.uniform(size=20000)
    found = reliability(list(zip(p.tolist(), (rng.uniform(size=p.size) < p).tolist(), strict=True)))
    assert len(found["bins"]) == 5
    assert found["brier"] == pytest.approx(1.0 / 6.0, abs=0.005)  # the integral of p (1 - p)
    assert all(abs(b["right"]["hits"] / b["right"]["of"] - b["mean"]) < 0.02 for b in found["bins"])


@pytest.mark.parametrize(("hits", "of"), [(0, 7), (3, 7), (7, 7), (120, 400)])
def test_interval_is_that_of_scipy(hits, of):
    exact = binomtest(hits, of).proportion_ci(0.95, "exact")
    assert interval(hits, of) == pytest.approx((exact.low, exact.high), abs=1e-9)


def test_limits_say_where_nothing_shows(summary):
    bias = next(entry for entry in summary["limits"] if entry["cause"] == "sea_bias")
    assert (bias["places"], bias["seen"]) == (6, 4)  # of two teams
    assert bias["parameters"]["bias_Nm"] == {"median": pytest.approx(0.03), "low": 0.02, "high": 0.04}
    push = next(entry for entry in summary["limits"] if entry["cause"] == "push")
    assert set(push["parameters"]) == {"force_x_N", "force_y_N"}


def test_what_failed_is_told_and_not_counted(summary):
    assert summary["sets"] == {
        "clean": 2, "hidden": 5, "diagnosed": 6,
        "failed": [{"key": "calibrated-0005-team1-slosh-x4", "error": "unstable", "unexpected": False}],
    }  # fmt: skip
    assert "slosh-x4: unstable" in format_campaign(summary)


def test_table_has_a_line_for_each_set(summary):
    rows = list(csv.DictReader(io.StringIO(csv_table(summary))))
    assert tuple(rows[0]) == COLUMNS
    assert [row["right"] for row in rows] == ["True", "False", "False", "True", "False", "True"]
    assert rows[-1]["extras"] == "sea_bias"


def test_summary_is_plain_and_text_fits(summary):
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    text = format_campaign(summary)
    assert max(map(len, text.splitlines())) <= 125
    assert "2 of 3 (9 to 99 %)" in text


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


def test_a_campaign_in_which_nothing_was_named():
    summary = summarise([result(one, [], "consistent") for one in CampaignPlan(teams=1, sets=0).clean_sets()])
    assert summary["reliability"] == {"number": 0, "right": 0, "brier": None, "bins": []}
    assert "something named in 0 of 1" in format_campaign(summary)
