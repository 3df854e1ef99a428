"""Encoders of a team that hold their last value for a while, told as findings beside a verdict."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from discrepancy.evidence.findings import Event, Finding
from discrepancy.team.verdict import TeamVerdict
from estimator.held import Held, without_held
from estimator.recording.model import Recording

TOLD = 3
"""Times that are told."""
PARTS = {"phi": "driven joint", "theta": "gimbal axis"}


def words_of(finding: Finding) -> dict[str, Any]:
    """Of a finding of ``with_held``, what it is, where and how often; of any other, none."""
    if "gaps" not in finding.shape:
        return {}
    kind, shape, robot = "held readings", finding.shape, re.search(r"robot (\d+)", finding.place)
    return {
        "kind": kind, "name": f"{kind} of {finding.place}", "robot": robot and int(robot[1]),
        "sentence": f"{finding.place[:1].upper()}{finding.place[1:]} holds its last value {shape['gaps']:.0f} times, "
                    f"for {100.0 * shape['share']:.1f} % of the time.",
    }  # fmt: skip


def with_held(verdict: TeamVerdict, recordings: Sequence[Recording]) -> TeamVerdict:
    """The verdict with a finding and a note for every encoder that holds its value in any of the trials.

    Rows that held readings reach are none of the verdict's, so that what else it finds is not due to them.
    """
    found: dict[tuple[str, int, int], list[tuple[int, Held]]] = {}
    for trial, recording in enumerate(recordings):
        for held in without_held(recording)[1]:
            found.setdefault((held.angle, held.robot, held.joint), []).append((trial, held))
    if not found:
        return verdict
    findings, notes = [], []
    for each in found.values():
        finding, note = _told(each, recordings)
        findings.append(finding)
        notes.append(note)
    known = verdict.verdict in ("consistent", "miscalibrated")
    return replace(
        verdict, verdict="explained" if known else verdict.verdict, findings=(*verdict.findings, *findings),
        notes=(*verdict.notes, *notes),
    )  # fmt: skip


def _told(each: Sequence[tuple[int, Held]], recordings: Sequence[Recording]) -> tuple[Finding, str]:
    """What one encoder does, as a finding, and in a sentence."""
    spans = [(trial, *span) for trial, held in each for span in held.spans]
    events = [
        Event(t, float(recordings[t].time[a]), (b - a) / recordings[t].metadata.rate_hz) for t, a, b in spans
    ]
    one, count, samples = each[0][1], sum(b - a for _, a, b in spans), sum(len(r.time) for r in recordings)
    place = f"the angle of {PARTS[one.angle]} {one.joint + 1} of robot {one.robot + 1}"
    shortest, longest = (1e3 * of(event.duration_s for event in events) for of in (min, max))
    when = ", ".join(f"{event.start_s:.2f} s of trial {event.trial + 1}" for event in events[:TOLD])
    note = (
        f"The encoder of {place} holds its last value {len(events)} times, for {shortest:.0f} to {longest:.0f} ms, in "
        f"all {100.0 * count / samples:.1f} % of the time, first from {when}. Rows that it reaches are left out."
    )
    finding = Finding(
        cause="unlisted", place=place, joint=one.joint + 1, members=(), probability=1.0, nothing=0.0, unlisted=1.0,
        over_nothing=sum(held.nats for _, held in each), event=events[0],
        shape={"gaps": float(len(events)), "share": count / samples},
    )  # fmt: skip
    return finding, note
