"""No verdict stands beside a figure that contradicts it unexplained."""

from __future__ import annotations

import pytest

from diagnosed import VERDICTS, scattered, small_diagnosis
from discrepancy import rules
from discrepancy.result.remains import farthest, remains
from discrepancy.result.lines import format_diagnosis
from mocobot_report.diagnosis.part import KINDS


def words(text: str) -> str:
    return " ".join(text.split())


def test_clean_verdicts_stand_alone() -> None:
    for verdict in ("explained", "consistent", "miscalibrated"):
        assert remains(small_diagnosis(verdict)) == []


def test_a_misfit_beside_a_verdict_is_told_with_its_place() -> None:
    values = small_diagnosis("partly_explained")
    values["residual"] |= {"chi2_per_n": 5.16}
    values["residual"]["nominal"] = values["residual"]["nominal"] | {"chi2_per_n": 7350.0}
    (said,) = remains(values)
    assert said == "A misfit of chi2/n 5.16 remains of 7350, where up to 1.15 is clean: somewhere."
    text = words(format_diagnosis(values))
    assert text.startswith(
        "PARTLY EXPLAINED. Robot 2, joint 1: the torque sensor reads 0.0500 +- 0.0010 N m too much."
    )
    assert said in text


def test_consistent_within_wide_tolerances_says_what_the_response_is_off_by() -> None:
    values = small_diagnosis("consistent")
    response = values["gain"]["held_out"]["before"] | {"chi2_per_n": 6123.0}
    values["gain"]["held_out"] = {"before": response, "after": response}
    (said,) = remains(values)
    assert "off by chi2/n 6120, where noise alone leaves 1" in said
    assert "tolerances" in said
    assert said in words(format_diagnosis(values))


@pytest.mark.parametrize(("share", "told"), [(0.79, True), (0.81, False)])
def test_a_response_that_causes_hardly_mend_is_told(share: float, told: bool) -> None:
    values = small_diagnosis()
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 3.1}
    values["gain"]["removed"]["share"] = share
    assert bool(remains(values)) == told
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 2.9}
    assert remains(values) == []


def test_the_response_of_parts_as_they_are_found_is_told() -> None:
    values = small_diagnosis()
    assert "as far off as it is found" not in format_diagnosis(values)
    found = values["gain"]["held_out"]["after"] | {"chi2_per_n": 12.34}
    values["gain"]["held_out"] |= {"as_found": found}
    assert "chi2/n 12.3 with every part as far off as it is found, within its tolerance, too" in words(
        format_diagnosis(values)
    )
    values["gain"]["held_out"]["after"] |= {"chi2_per_n": 69.0}
    values["gain"]["removed"]["share"] = 0.4
    (said,) = remains(values)
    assert said.endswith(
        "by chi2/n 69 (90 without them; noise alone leaves 1), by 12.3 with every part as far off as it is found, "
        "within its tolerance, too."
    )
    values = small_diagnosis("consistent")
    values["gain"]["held_out"] = dict.fromkeys(("before", "after"), found | {"chi2_per_n": 75.0}) | {
        "as_found": found
    }
    assert remains(values)[-1].startswith("It is by 12.3 with every part")


def test_a_small_rest_that_is_no_noise_is_told() -> None:
    values = small_diagnosis("partly_explained")
    values["residual"]["unlisted_nats"] = 1.2 * rules.UNLISTED_NATS
    (said,) = remains(values)
    assert (
        said
        == f"What remains is small (chi2/n 1.1), but no noise (by {1.2 * rules.UNLISTED_NATS:.0f} nats): somewhere."
    )


@pytest.mark.parametrize("verdict", ["explained", "miscalibrated"])
def test_the_remedy_of_what_is_off_everywhere_says_what_it_is_worth(verdict: str) -> None:
    values = small_diagnosis(verdict)
    values["scatter"] = [scattered()]
    worth = "each one is foretold to chi2/n 1.07, as designed to 8530."
    assert worth not in words(format_diagnosis(values))
    values["foretold"] = {"as_designed": 8530.0, "as_found": 1.07}
    assert words(format_diagnosis(values)).count(worth) == 1


@pytest.mark.parametrize("verdict", ["explained", "miscalibrated"])
def test_what_is_off_everywhere_is_told_once(verdict: str) -> None:
    values = small_diagnosis(verdict)
    values["scatter"] = [scattered()]
    told = "all places alike are off by more than their tolerances: zero of a gimbal axis."
    assert any(told in said for said in remains(values)) == (verdict == "explained")
    text = words(format_diagnosis(values))
    assert text.count('"mocobot calibrate"') == 1
    assert (
        "zero of a gimbal axis (theta_zero): 5.2 mrad, 52 times the tolerance; likelier than it by 140 nats."
        in text
    )
    assert farthest(values["scatter"][0]) in text


def test_the_places_farthest_off_are_told() -> None:
    """Three of four, in the unit of the spread; of a diagnosis that was written without them, none."""
    entry = scattered()
    said = "robot 2, joint 3 (-9.1 mrad), robot 1, joint 1 (7.2 mrad), robot 3, joint 2 (4 mrad)"
    assert farthest(entry) == said
    del entry["each"]
    assert farthest(entry) == ""
    values = small_diagnosis("miscalibrated") | {"scatter": [entry]}
    assert "Farthest" not in format_diagnosis(values)


def test_every_verdict_has_its_colour() -> None:
    assert set(KINDS) == set(VERDICTS)
    assert [KINDS[verdict] for verdict in ("miscalibrated", "unexplained")] == ["warn", "bad"]
