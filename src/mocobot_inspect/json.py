"""An inspection as JSON, strict: no NaN, None where something is not known. SI units; robots count from 1.

::

    format "mocobot-inspection", version 1
    log           name, level, robots, channels, assumed_design, calibrated (whether robots are as a calibration
                has them), free (whether the robots hold nothing)
    streams       per robot: samples, start_s and duration_s (after the log's first stamp), rate_hz, jitter_rms_s,
                  jitter_max_s, gaps, missing, longest_gap_s, longest_gap_at_s, duplicates, repeats, backwards,
                  farthest_back_s, farthest_back_at_s, recorder_s
                  (least and largest lead of the recorder's time over the stamps)
    channels      per robot and channel: lowest, highest, nans, infinities, wild (samples that no sensor reads), step,
                  noise, stuck_count, clipped_count, stuck and clipped (start_s after the robot's first stamp,
                  duration_s, value, jumps), oscillation (frequency_hz, amplitude, duration_s of a fast line that
                  stands out of the noise; or null)
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

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from mocobot_inspect.findings import findings
from mocobot_inspect.inspection import Inspection, differs
from mocobot_inspect.readiness import Readiness
from mocobot_inspect.stream.timing import Timing
from mocobot_inspect.text import ready_line
from mocobot_inspect.wiring.check import Wiring
from mocobot_inspect.wiring.misfit import Misfit

FORMAT, VERSION = "mocobot-inspection", 1
_STEP = ("step", "parameters", "unit", "rank", "condition", "singular_values", "noise", "weak")


def inspection_dict(found: Inspection) -> dict[str, Any]:
    """Plain JSON values."""
    seen, rested = found.survey, found.segments
    return plain(
        {
            "format": FORMAT,
            "version": VERSION,
            "log": {
                "name": found.name,
                "level": found.level,
                "robots": found.robots,
                "channels": found.channel_names,
                "assumed_design": found.assumed_design,
                "calibrated": found.units is not None,
                "free": found.free,
            },
            "streams": [_timing(t, seen.origin_ns) for t in seen.timing],
            "channels": [{c.name: without(c, "name") for c in of_robot} for of_robot in seen.channels],
            "excerpt": {
                "part_s": seen.excerpt_s,
                "stretches": _stretches(found.checked),
                "unchecked": found.unchecked,
            },
            "segments": rested and (without(rested, "rests") | {"rests": _stretches(rested.rests)}),
            "clocks": _clocks(found),
            "wiring": found.wiring and _wiring(found.wiring),
            "excitation": {
                "as_it_is": found.ready and _ready(found.ready),
                "undone": found.ready_undone and _ready(found.ready_undone),
            },
            "findings": findings(found),
            "ready": ready_line(found),
        }
    )


def plain(value: Any) -> Any:
    """Objects for dataclasses, lists for tuples, None for what is not finite."""
    if is_dataclass(value):
        return plain(without(value))
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return float(value) if np.isfinite(value) else None
    return value


def without(record: Any, *left_out: str) -> dict[str, Any]:
    """Fields of a dataclass by name."""
    return {f.name: getattr(record, f.name) for f in fields(record) if f.name not in left_out}


def _stretches(told: tuple[tuple[float, float], ...]) -> list[dict[str, float]]:
    return [{"start_s": start, "duration_s": duration} for start, duration in told]


def _timing(t: Timing, origin_ns: int) -> dict[str, Any]:
    start = None if t.first_ns is None else (t.first_ns - origin_ns) * 1e-9
    return {"start_s": start, "duration_s": t.duration_s} | without(t, "first_ns", "last_ns")


def _clocks(found: Inspection) -> list[dict[str, Any]] | None:
    clocks = found.clocks
    if clocks is None:
        return None
    numbers = ("offset_s", "offset_se_s", "drift", "drift_se")
    return [
        {name: getattr(clocks, name)[robot] for name in numbers}
        | {"differs": differs(clocks, robot), "why_not": clocks.why_not[robot]}
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
                "misfit_before": f.before,
                "misfit_after": f.after,
            }
            for f in wiring.found
        ],
        "tried": wiring.tried,
        "hidden": [mistake.to_dict() for mistake in wiring.hidden],
    }


def _misfit(misfit: Misfit) -> dict[str, Any]:
    return {
        "total": misfit.total,
        "relative": misfit.relative,
        "scaled": misfit.scaled,
        "faults": [fault.reason for fault in misfit.faults],
        "determined": misfit.determined,
        "mass_kg": misfit.mass,
        "span_m": misfit.span,
    }


def _ready(ready: Readiness) -> dict[str, Any]:
    return {
        "holds": ready.holds,
        "axes_radps": ready.axes,
        "steps": [{name: getattr(step, name) for name in _STEP} for step in ready.steps],
        "reasons": ready.reasons,
        "flags": ready.flags,
    }
