"""Encoders of a team that hold their last value for a while."""

from __future__ import annotations

from collections.abc import Sequence

from discrepancy.evidence.findings import Event
from discrepancy.evidence.held import HeldReadings
from estimator.quantisation import angle_of, without_held
from estimator.recording.model import Recording

KINDS = ("driven joint", "gimbal axis")


def held_in(recordings: Sequence[Recording]) -> list[HeldReadings]:
    """Those that do so in any of a team's trials."""
    events: dict[int, list[Event]] = {}
    nats: dict[int, float] = {}
    for trial, recording in enumerate(recordings):
        rate_hz = recording.metadata.rate_hz
        for held in without_held(recording)[1]:
            times = [Event(trial, float(recording.time[a]), (b - a) / rate_hz) for a, b in held.spans]
            events.setdefault(held.column, []).extend(times)
            nats[held.column] = nats.get(held.column, 0.0) + held.nats
    total_s, out = sum(len(r.time) / r.metadata.rate_hz for r in recordings), []
    for column, own in sorted(events.items()):
        kind, robot, joint = angle_of(column, recordings[0].metadata.robots)
        place = f"{KINDS[kind]} {joint + 1} of robot {robot + 1}"
        share = sum(event.duration_s for event in own) / total_s
        out.append(HeldReadings(place, joint + 1, f"the angle of {place}", own, share, nats[column]))
    return out
