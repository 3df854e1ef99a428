"""An inspection as JSON, strict: no NaN, None where something is not known. SI units; robots count from 1.

::

    format "mocobot-inspection", version 1
    log           name, level, robots, channels, assumed_design
    streams       per robot: samples, start_s and duration_s (after the log's first stamp), rate_hz, jitter_rms_s,
                  jitter_max_s, gaps, missing, longest_gap_s, longest_gap_at_s, duplicates, backwards, recorder_s
                  (least and largest lead of the recorder's time over the stamps)
    channels      per robot and channel: lowest, highest, nans, infinities, step, noise, stuck_count, clipped_count,
                  stuck and clipped (start_s after the robot's first stamp, duration_s, value)
    excerpt       part_s (of a long log, else null), stretches (start_s, duration_s), unchecked (why nothing was)
    segments      still_s, moving_s, rests (start_s, duration_s); or null
    clocks        per robot: offset_s, offset_se_s, drift, drift_se, differs, why_not; or null
    wiring        misfit and misfit_undone (total, relative, scaled, faults, determined, mass_kg, span_m), found (per
                  mistake: kind, robots, channels, sentence, alternatives, misfit_before, misfit_after, and its size),
                  tried, hidden (mistakes that would not show); or null
    excitation    as it is, and with the mistakes undone (or null): holds, axes_radps, steps (step, parameters, unit,
                  rank, condition, singular_values, noise, weak), reasons (null: can be estimated), flags
    findings      topic and sentence of all that is wrong
    ready         the last line of the text
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from mocobot_inspect.findings import findings
from mocobot_inspect.inspection import Inspection, differs
from mocobot_inspect.readiness import Readiness
from mocobot_inspect.stream.channels import Channel
from mocobot_inspect.stream.timing import Timing
from mocobot_inspect.text import ready_line
from mocobot_inspect.wiring.check import Wiring
from mocobot_inspect.wiring.misfit import Misfit

FORMAT, VERSION = "mocobot-inspection", 1


def inspection_dict(found: Inspection) -> dict[str, Any]:
    """Plain JSON values."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "log": {
            "name": found.name,
            "level": found.level,
            "robots": found.robots,
            "channels": list(found.channel_names),
            "assumed_design": found.assumed_design,
        },
        "streams": [_timing(t, found.survey.origin_ns) for t in found.survey.timing],
        "channels": [{c.name: _channel(c) for c in of_robot} for of_robot in found.survey.channels],
        "excerpt": {
            "part_s": list(found.survey.excerpt_s) if found.survey.excerpt_s is not None else None,
            "stretches": [{"start_s": a, "duration_s": b} for a, b in found.checked],
            "unchecked": found.unchecked,
        },
        "segments": None
        if found.segments is None
        else {
            "still_s": found.segments.still_s,
            "moving_s": found.segments.moving_s,
            "rests": [{"start_s": a, "duration_s": b} for a, b in found.segments.rests],
        },
        "clocks": _clocks(found),
        "wiring": None if found.wiring is None else _wiring(found.wiring),
        "excitation": {
            "as_it_is": None if found.ready is None else _ready(found.ready),
            "undone": None if found.ready_undone is None else _ready(found.ready_undone),
        },
        "findings": [{"topic": finding.topic, "sentence": finding.sentence} for finding in findings(found)],
        "ready": ready_line(found),
    }


def _timing(t: Timing, origin_ns: int) -> dict[str, Any]:
    values = asdict(t)
    del values["first_ns"], values["last_ns"]
    values["recorder_s"] = None if t.recorder_s is None else list(t.recorder_s)
    start = None if t.first_ns is None else (t.first_ns - origin_ns) * 1e-9
    return {"start_s": start, "duration_s": t.duration_s} | values


def _channel(c: Channel) -> dict[str, Any]:
    values = asdict(c)
    del values["name"]
    values |= {"step": _number(c.step), "noise": _number(c.noise)}
    return values | {"stuck": list(values["stuck"]), "clipped": list(values["clipped"])}


def _clocks(found: Inspection) -> list[dict[str, Any]] | None:
    clocks = found.clocks
    if clocks is None:
        return None
    return [
        {
            "offset_s": _number(clocks.offset_s[robot]),
            "offset_se_s": _number(clocks.offset_se_s[robot]),
            "drift": _number(clocks.drift[robot]),
            "drift_se": _number(clocks.drift_se[robot]),
            "differs": differs(clocks, robot),
            "why_not": clocks.why_not[robot],
        }
        for robot in range(found.robots)
    ]


def _wiring(wiring: Wiring) -> dict[str, Any]:
    return {
        "misfit": _misfit(wiring.as_is),
        "misfit_undone": _misfit(wiring.undone),
        "found": [
            f.mistake.to_dict()
            | {
                "alternatives": [m.to_dict() for m in f.alternatives],
                "misfit_before": _number(f.before),
                "misfit_after": _number(f.after),
            }
            for f in wiring.found
        ],
        "tried": wiring.tried,
        "hidden": [mistake.to_dict() for mistake in wiring.hidden],
    }


def _misfit(misfit: Misfit) -> dict[str, Any]:
    return {
        "total": _number(misfit.total),
        "relative": {name: _number(value) for name, value in misfit.relative.items()},
        "scaled": {name: _number(value) for name, value in misfit.scaled.items()},
        "faults": [fault.reason for fault in misfit.faults],
        "determined": misfit.determined,
        "mass_kg": _number(misfit.mass),
        "span_m": _number(misfit.span),
    }


def _ready(ready: Readiness) -> dict[str, Any]:
    return {
        "holds": ready.holds,
        "axes_radps": None if ready.axes is None else list(ready.axes),
        "steps": [
            {
                "step": step.step,
                "parameters": list(step.parameters),
                "unit": step.unit,
                "rank": step.rank,
                "condition": _number(step.condition),
                "singular_values": [_number(value) for value in step.singular_values],
                "noise": _number(step.noise),
                "weak": [asdict(weak) | {"vector": list(weak.vector)} for weak in step.weak],
            }
            for step in ready.steps
        ],
        "reasons": dict(ready.reasons),
        "flags": list(ready.flags),
    }


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
