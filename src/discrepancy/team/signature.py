"""Where the misfit sits: channels, trials, speed, frequency, and whose torques it points along."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from discrepancy.channel import Channel
from discrepancy.numbers import three_digits
from discrepancy.team.linear.trial_linear import TrialLinear
from discrepancy.team.linear.whitening import Whitening
from estimator.arrays import Array
from estimator.rigid_team.slots import PHI, TAU, THETA

if TYPE_CHECKING:
    from discrepancy.team.rig import TeamRig


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


def channels_of(robots: int) -> list[Channel]:
    """Channels of N robots, 6 N."""
    out = []
    for i in range(2, robots + 1):
        out += [Channel(f"grasp {i} rotation {a}", "kinematic", i, "rad") for a in "xyz"]
        out += [Channel(f"grasp {i} position {a}", "kinematic", i, "m") for a in "xyz"]
    out += [Channel(f"force {a}", "balance", None, "N") for a in "xyz"]
    return out + [Channel(f"moment {a}", "balance", None, "N m") for a in "xyz"]


def quantities_of(linear: TrialLinear) -> dict[str, Array]:
    """Speed of the payload [m/s], its distance from where it started [m], load [N m]: shape (n,) each."""
    at = linear.reduction.sample
    twist = linear.data.twist[at]
    h = linear.data.p_bi[at]
    return {
        "speed": np.sqrt(np.mean(twist[..., 3:] ** 2, axis=(1, 2))),
        "position": np.sqrt(np.mean((h - h.mean(axis=0)) ** 2, axis=(1, 2))),
        "load": np.sqrt(np.mean(linear.s[at, :, TAU] ** 2, axis=(1, 2))),
    }


def directions_of(linear: TrialLinear, white: Whitening) -> dict[str, Array]:
    """Unit directions in the whitened rows of every spring torque and angle, shape (n, C, 1) each."""
    out = {}
    for robot in range(linear.robots):
        J = linear.J.at(robot, slice(None), linear.reduction.sample)
        whose = f"robot {robot + 1}'s"
        tau, phi, theta = (J[:, :, kind] for kind in (TAU, PHI, THETA))
        for k in range(3):
            out[f"{whose} torque channel {k + 1}"] = _unit(white.rows_only(tau[..., k]))
            out[f"{whose} driven angle {k + 1}"] = _unit(white.rows_only(phi[..., k]))
            out[f"{whose} gimbal angle {'zyx'[k]}"] = _unit(white.rows_only(theta[..., k]))
    return out


def _unit(x: Array) -> Array:
    """Rows (n, C) to unit length, as one direction each, shape (n, C, 1)."""
    return (x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300))[..., None]
