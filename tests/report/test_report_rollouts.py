"""Rollouts of a serial robot, in text and on the page: errors of every joint, and what diverged."""

from __future__ import annotations

import re
from typing import Any

from discrepancy.result.tables import rollout_lines
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node
from mocobot_report.diagnosis.evidence import rollout_section


def words(node: Node | None) -> str:
    """The text of a part of the page."""
    assert node is not None
    return " ".join(node.itertext())


def rolled(*, named: bool = True) -> dict[str, Any]:
    """Two joints, one of which slides; at the second horizon the first diverged in the given model."""

    def side(first: float | None, second: float, gone: int) -> dict[str, Any]:
        return {"rms": [first, second], "diverged": [gone, 0]}

    def horizon(
        seconds: float, before: dict[str, Any], after: dict[str, Any], removed: list[Any]
    ) -> dict[str, Any]:
        return {"seconds": seconds, "starts": 40, "before": before, "after": after if named else None,
                "removed": removed if named else None}  # fmt: skip

    return {
        "joints": ["hip", "lift"],
        "units": ["rad", "m"],
        "validated": True,
        "why_not": None,
        "horizons": [
            horizon(0.1, side(0.05, 0.004, 0), side(0.01, 0.001, 0), [0.8, 0.75]),
            horizon(0.5, side(None, 0.02, 30), side(0.08, 0.005, 0), [None, 0.75]),
        ],
        "not_simulated": ["elasticity of joint 1 (hip)"],
        "refused": [],
        "commanded": {
            "why_not": None, "joints": [1],
            "blocks": [
                {"name": "one", "seconds": 6.0, "motion": [0.5, 0.1], "before": [0.03, 0.002],
                 "after": [0.02, 0.001] if named else None},
                {"name": "two", "seconds": 6.0, "motion": [0.5, 0.1], "before": [None, 0.002],
                 "after": [0.02, 0.001] if named else None},
            ],
            "before": [0.03, 0.002], "after": [0.02, 0.001] if named else None,
            "removed": [0.33, 0.5] if named else None,
        },
    }  # fmt: skip


def test_text_has_every_joint_and_counts_what_diverged() -> None:
    text = "\n".join(rollout_lines({"rollouts": rolled()}))
    assert re.search(r"hip \[mrad\] +50 -> 10 \(80 %\) +diverged -> 80\n", text)
    assert re.search(r"lift \[mm\] +4 -> 1 \(75 %\) +20 -> 5 \(75 %\)\n", text)
    assert "Rollouts of the given model that diverged in the worst joint: 30 of 40 at 0.5 s;" in text
    assert "Not in the rollouts: elasticity of joint 1 (hip)." in text
    assert re.search(r"hip \[mrad\] +30 -> 20 \(33 %\)\n", text)
    assert "1 of 2 blocks of the given model diverged" in text
    assert max(map(len, text.splitlines())) <= 100


def test_text_where_nothing_is_named() -> None:
    text = "\n".join(rollout_lines({"rollouts": rolled(named=False)}))
    assert re.search(r"hip \[mrad\] +50 +diverged\n", text)
    assert "->" not in text


def test_text_says_why_there_is_none() -> None:
    assert rollout_lines({"rollouts": None}) == rollout_lines({}) == []
    why = {"why_not": "the log has no commands", "joints": [], "blocks": []}
    none = rolled() | {"why_not": "no torque of joint hip is known", "horizons": []}
    none["commanded"] = why | {"before": None, "after": None, "removed": None}
    text = "\n".join(rollout_lines({"rollouts": none}))
    assert "Not rolled out freely: no torque of joint hip is known." in text
    assert "The closed loop was not simulated: the log has no commands." in text
    page = words(rollout_section(Book(), {"rollouts": none}))
    assert "no torque of joint hip is known" in page
    assert "the log has no commands" in page


def test_page_has_the_same_numbers() -> None:
    section = rollout_section(Book(), {"rollouts": rolled()})
    page = words(section)
    for said in ("Simulated from measured states", "hip", "mrad", "mm", "30 of 40", "elasticity of joint 1"):
        assert said in page
    assert rollout_section(Book(), {}) is None
    bare = words(rollout_section(Book(), {"rollouts": rolled(named=False)}))
    assert "removed" not in bare
