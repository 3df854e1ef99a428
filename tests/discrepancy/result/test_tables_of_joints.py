"""Tables of a serial robot's report: every line fits, columns stand apart, joints are told apart."""

from __future__ import annotations

import re

import pytest

from discrepancy.result.tables import gain_lines, rollout_lines

SIZES = (0.0128, 0.00152, 0.000339)


def rollouts(joints: list[str]) -> dict:
    def horizon(seconds: float, factor: float) -> dict:
        before = {"rms": [factor * x for x in SIZES], "diverged": [0, 0, 0]}
        after = {"rms": [0.0123 * factor * x for x in SIZES], "diverged": [0, 0, 0]}
        return {
            "seconds": seconds,
            "starts": 60,
            "before": before,
            "after": after,
            "removed": [1.0, 0.99, 0.0],
        }

    return {
        "rollouts": {
            "why_not": None, "validated": True, "horizons": [horizon(0.1, 1.0), horizon(0.2, 3.5), horizon(0.5, 19.0)],
            "joints": joints, "units": ["rad"] * 3, "not_simulated": [], "refused": [],
            "commanded": {"why_not": None, "before": [0.01, 0.02, 0.03], "after": [0.001] * 3, "removed": [0.9] * 3,
                          "blocks": []},
        }
    }  # fmt: skip


@pytest.mark.parametrize(
    ("joints", "called"),
    [
        (["turret", "shoulder", "elbow"], ["turret", "shoulder", "elbow"]),
        (["right_shoulder_pan", "right_shoulder_lift", "right_elbow"],) * 2,
        ([f"a_very_long_name_of_a_joint_of_an_arm_{k}" for k in "abc"], ["joint 1", "joint 2", "joint 3"]),
    ],
)
def test_rollouts_are_a_table(joints: list[str], called: list[str]) -> None:
    lines = rollout_lines(rollouts(joints))
    assert max(map(len, lines)) <= 100
    rows = [line for line in lines if "->" in line and "given model" not in line]
    assert len(rows) == 6
    for row, name in zip(rows, [*called, *joints], strict=True):
        first, *cells = re.split(r"\s{2,}", row.strip())
        assert first == f"{name} [mrad]"
        assert all(re.fullmatch(r"[\d.]+ -> [\d.]+ \(\d+ %\)", cell) for cell in cells), row


def test_torques_are_predicted_from_the_motion_and_their_columns_stand_under_their_heads() -> None:
    channels = ["shoulder_lift_joint torque", "elbow torque"]
    errors = {f"{c}_{what}": x for c in channels for what, x in (("rms", 1.5), ("nrmse", 0.12))}
    gain = {
        "held_out": {"before": errors | {"chi2_per_n": 9.0}, "after": errors | {"chi2_per_n": 1.0}},
        "validated": True, "units": dict.fromkeys(channels, "N m"), "removed": None, "trials": [],
        "noise": {f"{c}_rms": 0.1 for c in channels},
    }  # fmt: skip
    lines = gain_lines({"gain": gain, "causes": ["one"]})
    assert lines[1] == "[[Torques, predicted from the recorded motion (on trials left out of the fit)]]"
    ends = {line.index("before") + len("before") for line in lines if "before" in line}
    ends |= {
        re.search(r"(%\]|n)\s+[\d.]+", line).end() for line in lines[3:] if "%" in line or "chi2" in line
    }  # type: ignore[union-attr]
    assert len(ends) == 1, lines
