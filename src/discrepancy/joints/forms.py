"""What a cause leaves where its law has another form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy.evidence.posterior import Group
from estimator.arrays import Array


def _unit(x):
    return x / (np.sqrt(np.mean(x**2)) + 1e-12)


def smooth(s) -> list[Array]:
    """Smooth functions of position, speed, direction and time, of about unit size."""
    q = 2.0 * (s.q - s.middle) / s.travel
    w = np.clip(np.log(np.abs(s.v) / s.speed + 1e-2), -4, 2) / 1.5 + 0.3
    time = 2.0 * s.t / s.until - 1.0
    return [q, 1.5 * q**2 - 0.5, w, w**2 - 1.0, s.direction, time, 1.5 * time**2 - 0.5]


def forms_of(B, series: Sequence[dict], group: Group, values: Array) -> list[dict[int, list[Array]]]:
    """Trace of the cause times smooth functions of position, speed, direction and time."""
    out = []
    channels = {c for k in group.columns for c in series[k]}
    if group.cause in ("link_mass", "link_com", "link_inertia", "payload", "gravity_direction", "gravity_compensation", "joint_zero", "link_length"):
        return []
    for c in channels:
        trace = [sum(values[k] * series[k][c][t] for k in group.columns if c in series[k]) for t in range(len(B.joints[c]))]
        ss = B.joints[c]
        each = [smooth(s) for s in ss]
        for i in range(len(each[0])):
            out.append({c: [e * b[i] for e, b in zip(trace, each, strict=True)]})
        size = np.sqrt(np.mean(np.concatenate(trace) ** 2))
        slope = [np.gradient(e, s.dt) for e, s in zip(trace, ss, strict=True)]
        n = np.sqrt(np.mean(np.concatenate(slope) ** 2)) + 1e-12
        out.append({c: [x * size / n for x in slope]})
    return out
