"""Rollouts of a serial robot as text: errors of every joint, and what diverged."""

from __future__ import annotations

import re

from discrepancy.result.tables import rollout_lines
from report_folders import rolled


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
