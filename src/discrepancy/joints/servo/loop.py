"""What a position loop makes of an error, as the logs have it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from estimator.arrays import Array
from estimator.statistics import measured
from mocobot_logs.joints.joint_log import JointLog

MOST_LOOP_SHARE = 0.1
"""Share of a duty's variance that a loop's law may leave. Chosen: what leaves more is another kind of loop."""
LATE_S = 1e-3
"""Lag of a loop that is worth a word. Chosen: less is within the stamps of a bus."""
CUT_OFF_SHARE, LEAST_CUT_OFF, CUT_OFF_SAMPLES = 0.97, 0.003, 7
"""Share of the largest duty up to which the law of a loop is fitted; the share of the time in which that law asks for
more than the largest by as much, from which it is cut off; and samples left out around a large one. Chosen:
resampling ripples for three samples on either side."""
LOOP_STRETCH_S = 1.0
"""Stretches whose scatter gives a loop's standard errors. Chosen: longer than any loop remembers."""
LEAST_ROWS = 40
"""That a block must have to be one. Chosen."""


@dataclass(frozen=True)
class LoopLaw:
    """A proportional loop at one joint: output = gain * (error ``late_s`` ago) + offset, cut off at ``limit``.

    Attributes:
        joint: which, from 0.
        gain: of the position loop as the map has it, NaN where that is not known.
        per_rad: output per rad or m of error.
        se: its standard error, from the scatter between stretches of a second.
        late_s: how long the loop takes, the readings' own lag included [s].
        offset: in the output's unit.
        limit: most that was given where the loop was cut off; inf where it was not.
        left: root mean square of what the law leaves, in the output's unit.
        share: of the output's variance that it leaves.
        logs: how many it was fitted to.
    """

    joint: int
    gain: float
    per_rad: float
    se: float
    late_s: float
    offset: float
    limit: float
    left: float
    share: float
    logs: int


def loop_laws(logs: Sequence[JointLog]) -> list[LoopLaw]:
    """The laws of all joints with a position command and a duty, one per gain.

    Args:
        logs: of one robot; those whose drives are commanded something else are left out.
    """
    told = [log for log in logs if _commanded(log)]
    if not told:
        return []
    laws = []
    for j in range(len(told[0].joints)):
        by_gain: dict[float, list[JointLog]] = {}
        for log in told:
            if log.command is not None and log.drive.duty is not None:
                here = np.isfinite(log.command[:, j]) & np.isfinite(log.drive.duty[:, j])
                if here.any():
                    gain = float(log.drive.position_gain[j])
                    by_gain.setdefault(-1.0 if np.isnan(gain) else gain, []).append(log)
        for gain, own in sorted(by_gain.items()):
            law = _law(own, j, gain if gain > 0 else np.nan)
            if law is not None:
                laws.append(law)
    return laws


def sentences(laws: Sequence[LoopLaw], joints: Sequence[str]) -> Iterator[str]:
    """What is to be said of them, one sentence per joint.

    Args:
        laws: of ``loop_laws``.
        joints: names.
    """
    for j in dict.fromkeys(law.joint for law in laws):
        own = [law for law in laws if law.joint == j]
        good = [law for law in own if law.share < MOST_LOOP_SHARE]
        if not good:
            yield f"Loop of joint {joints[j]}: its duty does not go with the error of its position."
            continue
        said = ", ".join(_said(law) for law in good)
        per_gain = np.array([law.per_rad / law.gain for law in good])
        more = ""
        if len(good) > 1 and np.isfinite(per_gain).all():
            off = np.ptp(per_gain) / per_gain.mean()
            more = f"; {per_gain.mean():.4g} per rad and unit of gain, the same within {100.0 * off:.1f} %"
        late, left = float(np.median([law.late_s for law in good])), max(law.left for law in good)
        delay = f"is {1e3 * late:.1f} ms late and " if abs(late) > LATE_S else ""
        yield f"Loop of joint {joints[j]}: {said}{more}. It {delay}leaves {left:.2g} of full duty at most (rms)."


def _said(law: LoopLaw) -> str:
    value, se = measured(law.per_rad, law.se)
    at = "" if np.isnan(law.gain) else f" at gain {law.gain:g}"
    cut = "" if np.isinf(law.limit) else f" (cut off at {law.limit:.3g})"
    return f"{value} +- {se} of full duty per rad of error{at}{cut}"


def _commanded(log: JointLog) -> bool:
    return log.drive.command == "position" and log.command is not None and log.drive.duty is not None


def _law(logs: Sequence[JointLog], j: int, gain: float) -> LoopLaw | None:
    peak = min(max(float(np.nanmax(np.abs(_duty(log, j)))) for log in logs), 1.0)  # resampling overshoots
    rows, outputs, stretches, every = [], [], [], []
    for log in logs:
        assert log.command is not None
        error, duty = log.command[:, j] - log.q[:, j], _duty(log, j)
        rate = np.gradient(error, log.period_s)
        here = log.usable & np.isfinite(error) & np.isfinite(duty)
        if log.enabled is not None:
            here &= log.enabled
        here[[0, -1]] = False
        columns = np.column_stack([error, -rate, np.ones(len(error))])
        every.append(columns[here])
        # What may be cut off does not follow the law.
        here &= maximum_filter1d(np.abs(duty), CUT_OFF_SAMPLES) < CUT_OFF_SHARE * peak
        rows.append(columns[here])
        outputs.append(duty[here])
        start = stretches[-1].max(initial=0) + 1 if stretches else 0
        stretches.append((start + log.time / LOOP_STRETCH_S).astype(int)[here])
    A, b, stretch = np.concatenate(rows), np.concatenate(outputs), np.concatenate(stretches)
    if len(b) < LEAST_ROWS or np.linalg.matrix_rank(A) < A.shape[1]:
        return None
    normal = np.linalg.inv(A.T @ A)
    found = normal @ (A.T @ b)
    left = b - A @ found
    scores = np.array([A[stretch == k].T @ left[stretch == k] for k in np.unique(stretch)])
    covariance = normal @ (scores.T @ scores) @ normal
    beyond = np.abs(np.concatenate(every) @ found) > peak / CUT_OFF_SHARE
    cut = np.mean(beyond) > LEAST_CUT_OFF
    share = float(np.sum(left**2) / max(np.sum((b - b.mean()) ** 2), 1e-300))
    return LoopLaw(
        j, gain, float(found[0]), float(np.sqrt(covariance[0, 0])), float(found[1] / found[0]), float(found[2]),
        peak if cut else np.inf, float(np.sqrt(np.mean(left**2))), share, len(logs),
    )  # fmt: skip


def _duty(log: JointLog, j: int) -> Array:
    assert log.drive.duty is not None
    return log.drive.duty[:, j]
