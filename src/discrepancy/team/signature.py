"""Where the misfit sits: channels, trials, speed, frequency, and whose torques it points along."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from discrepancy.numbers import three_digits
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array


def signature(rig: TeamRig, z: Sequence[Array]) -> dict[str, Any]:
    """Describe what is left of the whitened residual beyond noise, shape (n, C) a trial, as plain numbers.

    Returns:
        ``chi2_per_n`` in all and by ``kind`` of channel, ``robot``, ``trial``; ``moving_share``: part of the excess
        while the rig moves; ``correlation`` of its size with the rig's explanatory quantities; ``frequency_hz``:
        median frequency of the worst channel; ``along``: the source along which most of it points; ``sentence``.
    """
    squares = np.concatenate([(x**2) for x in z])
    out: dict[str, Any] = {"chi2_per_n": float(squares.mean())}
    kinds = sorted({channel.kind for channel in rig.channels})
    out["kind"] = {
        kind: float(squares[:, [k for k, c in enumerate(rig.channels) if c.kind == kind]].mean())
        for kind in kinds
    }
    out["channel"] = {c.name: float(squares[:, k].mean()) for k, c in enumerate(rig.channels)}
    out["trial"] = {name: float((x**2).mean()) for name, x in zip(rig.trials, z, strict=True)}
    size = np.concatenate([(x**2).mean(axis=1) for x in z])
    quantities = [rig.quantities(t) for t in range(len(rig.trials))]
    out["correlation"] = {}
    for name in quantities[0]:
        values = np.concatenate([q[name] for q in quantities])
        constant = np.std(values) < 1e-12 or np.std(size) < 1e-12
        out["correlation"][name] = 0.0 if constant else float(np.corrcoef(values, np.log(size + 1e-12))[0, 1])
    speed = np.concatenate([q["speed"] for q in quantities])
    moving = speed > 0.2 * np.sqrt(np.mean(speed**2))
    excess = np.maximum(size - 1.0, 0.0)
    out["moving_share"] = float(excess[moving].sum() / max(excess.sum(), 1e-12))
    worst = int(np.argmax(squares.mean(axis=0)))
    out["worst_channel"] = rig.channels[worst].name
    out["frequency_hz"] = _median_frequency(rig, z, worst)
    out["along"] = _along(rig, z)
    out["sentence"] = _sentence(out)
    return out


def _median_frequency(rig: TeamRig, z: Sequence[Array], channel: int) -> float:
    power, at = 0.0, None
    for t, x in enumerate(z):
        rate = rig.row_rate_hz(t)
        series = x[: len(x) // 2 * 2, channel]
        spectrum = np.abs(np.fft.rfft(series, 512)) ** 2
        power, at = power + spectrum, np.fft.rfftfreq(512, 1.0 / rate)
    total = np.cumsum(power)
    return float(at[np.searchsorted(total, 0.5 * total[-1])]) if at is not None else 0.0


def _along(rig: TeamRig, z: Sequence[Array]) -> dict[str, float]:
    """Share of the squared residual along each source's own direction (one of C dimensions, or a few)."""
    shares: dict[str, list[float]] = {}
    total = sum(float(np.sum(x**2)) for x in z)
    for t, x in enumerate(z):
        for name, directions in rig.directions(t).items():
            inside = np.einsum("nc,nck->nk", x, directions)
            shares.setdefault(name, []).append(float(np.sum(inside**2)))
    ranked = sorted(((sum(v) / max(total, 1e-12), k) for k, v in shares.items()), reverse=True)
    return {name: share for share, name in ranked[:5]}


def _sentence(out: dict[str, Any]) -> str:
    kind = max(out["kind"], key=lambda k: out["kind"][k])
    source, share = next(iter(out["along"].items()), ("no single source", 0.0))
    motion = "while it moves" if out["moving_share"] > 0.6 else "at rest and in motion alike"
    return (
        f"chi2/n is {three_digits(out['kind'][kind])} in the {kind} channels (worst: {out['worst_channel']}, around "
        f"{out['frequency_hz']:.1f} Hz); {100 * share:.0f} % of the misfit lies along {source}, {motion}."
    )
