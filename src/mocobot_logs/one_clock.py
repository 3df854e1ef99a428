"""Combine uniform grids with several clocks into one recording on the clock of robot 1.

The recording begins at the first instant of robot 1's grid at which every robot has samples, and time counts from
there. A robot whose grid lies within 1 us of all these instants keeps its samples bit for bit. The others are
interpolated by a quintic spline. For a sine sampled at 100 Hz its relative error is below 1e-7 at 5 Hz and below
1e-11 at 1 Hz.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from estimator.arm.delta import joints_of, wrist_fault
from estimator.arm.design import OmnidDesign
from estimator.clocks import ClockEstimate, estimate_clocks, unknown_clocks
from estimator.errors import InputError
from estimator.filtering import MIN_SAMPLES
from estimator.recording.metadata import FREE, RecordingMetadata, Sampling
from estimator.recording.model import Recording
from mocobot_logs.log import CHANNELS, NS, REF, THETA, Array
from mocobot_logs.resample import Resampled

EARLY_S = 1.0
"""Largest difference between the ends of the robots' logs [s]; beyond it, one counts as broken off."""
_SAME_S = 1e-6
_SUSPECT_S = 0.5  # larger clock differences explain why logs end apart


@dataclass(frozen=True, eq=False)
class ClockReport:
    """Estimated clocks of the robots, and their effect on the recording."""

    # offsets and drifts of the log before correction, in seconds after the log's ``origin_ns``
    estimate: ClockEstimate
    corrected: bool  # whether the samples were shifted accordingly
    start_s: float  # first instant of the recording by the clock of robot 1 after the log's origin [s]
    lost_s: Array  # time of each robot before the first and after the last instant, shape (N, 2) [s]
    untouched: tuple[bool, ...]  # whether each robot's samples stayed on its own grid


def to_recording(
    resampled: Resampled,
    *,
    design: OmnidDesign | None = None,
    trial: str | None = None,
    payload: str | None = None,
    source: str | None = None,
    correct: bool = False,
    cut: bool = False,
) -> tuple[Recording, ClockReport]:
    """Put all robots on one clock; return the recording, at joint level whatever the log's level, and the clock report.

    Given labels override those of the log; labels that the log lacks must be given. Refused are clocks to correct that
    the motion does not determine, a log that ends more than a second before another, fewer than 16 common samples, and
    wrist positions out of reach.

    Args:
        resampled: the log.
        design, trial, payload: design of the robots, kind of trial, name of the payload.
        source: origin of the samples; by default the log's name.
        correct: whether to remove each clock's offset and drift against robot 1. Otherwise stamps are trusted.
        cut: whether the log was cut out of another one by stamps. Robots whose stamps end together then do not count as
            broken off, whatever their clocks.
    """
    stated = {"design": design, "trial": trial, "payload": payload, "source": source}
    metadata = _metadata(resampled, {key: value for key, value in stated.items() if value is not None})
    if metadata.trial == FREE:
        why = "the robots hold nothing, so they do not move together"
        estimate = unknown_clocks(resampled.robots, float(resampled.start_s[0]), why)
    else:
        start = CHANNELS[resampled.level].index(THETA[0])
        theta = [values[:, start : start + 3] for values in resampled.values]
        estimate = estimate_clocks(theta, resampled.start_s, resampled.rate_hz)
    for i, why in enumerate(estimate.why_not if correct else ()):
        if why is not None:
            raise InputError(
                f"{resampled.name}: the clock of robot {i + 1} cannot be told from the motion and so not be "
                f"corrected: {why}"
            )
    N, rate_hz = resampled.robots, resampled.rate_hz
    offset_s, drift = (estimate.offset_s, estimate.drift) if correct else (np.zeros(N), np.zeros(N))
    ends_s = resampled.start_s + (np.array([len(x) for x in resampled.values]) - 1) / rate_hz
    # first and last instants of the robots in the time of robot 1
    from_s, to_s = (
        estimate.middle_s + (stamp - estimate.middle_s - offset_s) / (1.0 + drift)
        for stamp in (resampled.start_s, ends_s)
    )
    if not (cut and np.ptp(ends_s) <= EARLY_S):
        _check_ends(resampled.name, to_s, estimate, correct=correct)
    first = math.ceil((from_s.max() - resampled.start_s[0] - _SAME_S) * rate_hz)
    last = math.floor((to_s.min() - resampled.start_s[0] + _SAME_S) * rate_hz)
    if last - first + 1 < MIN_SAMPLES:
        raise InputError(
            f"{resampled.name}: the robots have {max(0, last - first + 1)} samples in common; "
            f"at least {MIN_SAMPLES} are needed"
        )
    time_s = resampled.start_s[0] + np.arange(first, last + 1) / rate_hz
    arrays = {field: np.empty((len(time_s), N, 3)) for field in ("position", "theta", "effort")}
    ref = np.empty((len(time_s), N, 3)) if REF[0] in resampled.channels else None
    untouched = []
    for i in range(N):
        stamps = time_s + offset_s[i] + drift[i] * (time_s - estimate.middle_s)
        at = (stamps - resampled.start_s[i]) * rate_hz
        values, same = _values_at(resampled.values[i], at, _SAME_S * rate_hz)
        untouched.append(same)
        arrays["position"][:, i], arrays["theta"][:, i], arrays["effort"][:, i] = np.split(
            values[:, :9], 3, axis=1
        )
        if ref is not None:
            ref[:, i] = values[:, 9:]
    read_s = np.array([(report.first_ns - resampled.origin_ns) * NS for report in resampled.reports])
    read_s = estimate.middle_s + (read_s - estimate.middle_s - offset_s) / (1.0 + drift) - time_s[0]
    metadata = replace(
        metadata,
        sampling=_sampling(resampled, float(time_s[0]), read_s, 1.0 + drift, untouched, aligned=correct),
    )
    if resampled.level == "wrist":
        _to_joints(arrays["position"], arrays["effort"], metadata.design, resampled.name, rate_hz)
    recording = Recording(
        time=np.arange(len(time_s)) / rate_hz,
        phi=arrays["position"],
        theta=arrays["theta"],
        tau=arrays["effort"],
        ref=ref,
        metadata=metadata,
        name=resampled.name,
    )
    lost_s = np.maximum(np.stack([time_s[0] - from_s, to_s - time_s[-1]], axis=1), 0.0)
    return recording, ClockReport(estimate, correct, float(time_s[0]), lost_s, tuple(untouched))


def _metadata(resampled: Resampled, given: dict[str, Any]) -> RecordingMetadata:
    known = resampled.metadata
    fixed = {"robots": resampled.robots, "rate_hz": resampled.rate_hz, "level": resampled.level}
    if known is not None:
        # A calibration of one design does not apply to another.
        units = known.units if given.get("design", known.design) == known.design else None
        found = replace(known, **fixed, **given, units=units)
    else:
        for key in ("design", "trial"):
            if key not in given:
                raise InputError(f"{resampled.name}: says nothing about its {key}, which must be given")
        rest = {"source": f"log {resampled.name}", "payload": None, "seed": None}
        found = RecordingMetadata(**(rest | given | fixed))
    if found.trial == FREE and found.payload is not None:
        raise InputError(
            f"{resampled.name}: payload is {found.payload!r:.60}, but in a free trial the robots hold nothing; leave "
            "the payload out, or give another trial"
        )
    return found


def _sampling(
    resampled: Resampled,
    start_s: float,
    first_s: Array,
    speed: Array,
    untouched: Sequence[bool],
    *,
    aligned: bool,
) -> tuple[Sampling, ...] | None:
    """Return how the sensors were sampled, or None if the samples are unchanged.

    The recording starts ``start_s`` after the log's origin, where robots' first samples are at ``first_s`` (N,) [s].
    ``speed`` (N,) is the rate of each clock relative to that of robot 1; ``aligned`` says whether clocks were
    corrected.
    """
    if resampled.metadata is not None and (known := resampled.metadata.sampling) is not None:
        # A log converted before keeps the errors of its first sampling. Its stamps are the recording's time, and this
        # recording may begin later.
        later = [sampling.later(resampled.origin_ns * NS + start_s) for sampling in known]
        return tuple(replace(s, aligned=s.aligned or (aligned and i > 0)) for i, s in enumerate(later))
    reports = resampled.reports
    if all(untouched) and all(report.method == "untouched" and not report.filled for report in reports):
        return None
    return tuple(
        Sampling(
            native_hz=report.native_hz * float(speed[i]),
            first_s=float(first_s[i]),
            # an interval has the errors of both of its ends
            jitter_s=report.jitter_rms_s / math.sqrt(2.0),
            missing=report.filled_share,
            aligned=aligned and i > 0,
            method=report.method,
            level=resampled.level,
            steps=report.steps,
        )
        for i, report in enumerate(reports)
    )


def _check_ends(name: str, ends_s: Array, estimate: ClockEstimate, *, correct: bool) -> None:
    """Refuse a log that ends for one robot before the others."""
    early, late = int(np.argmin(ends_s)), int(np.argmax(ends_s))
    short_s = ends_s[late] - ends_s[early]
    if short_s <= EARLY_S:
        return
    apart_s = estimate.offset_s[early] - estimate.offset_s[late]
    hint = ""
    if not correct and abs(apart_s) > _SUSPECT_S:
        hint = (
            f" (by the motion, the clock of robot {early + 1} differs from that of robot {late + 1} by "
            f"{apart_s:+.3g} s: correct the clocks)"
        )
    raise InputError(
        f"{name}: the log of robot {early + 1} ends {short_s:.4g} s before that of robot {late + 1}; "
        f"at most {EARLY_S:g} s is allowed{hint or ' (convert --crop keeps what all have)'}"
    )


def _values_at(values: Array, at: Array, tolerance: float) -> tuple[Array, bool]:
    """Return samples (Q, C) at fractional indices, and whether these are integers within ``tolerance``."""
    nearest = np.rint(at).astype(np.int64)
    if np.all(np.abs(at - nearest) <= tolerance):
        return values[nearest], True
    # Interpolate only the requested range, with a margin that hides the spline's ends.
    low, high = max(0, int(at[0]) - 64), min(len(values), int(at[-1]) + 66)
    spline = make_interp_spline(np.arange(low, high), values[low:high], k=5)
    return spline(np.clip(at, low, high - 1)), False


def _to_joints(h: Array, force: Array, design: OmnidDesign, name: str, rate_hz: float) -> None:
    """Convert wrist positions and forces, shape (Q, N, 3), into driven angles and torques in place."""
    for i in range(h.shape[1]):
        fault = wrist_fault(h[:, i], design)
        if fault is not None:
            (row,), what = fault
            raise InputError(
                f"{name}: robot {i + 1}, {row / rate_hz:.6g} s after the recording's beginning: {what}; "
                "are unit, sign and offset of the wrist's channels right?"
            )
        h[:, i], force[:, i] = joints_of(h[:, i], force[:, i], design)
