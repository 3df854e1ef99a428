"""What the machines are told to do: chirps, sums of sines and steps around a pose."""

from __future__ import annotations

import numpy as np

from commanded.bodies import Kind

SECONDS = 30.0
SLOWEST_HZ = 0.1
CORNER_HZ = {"leg": 1.5, "arm": 0.8}
"""Above it amplitudes fall with the frequency, so that speeds stay within what the drives can do."""


def _chirp(t: np.ndarray, most_hz: float, corner: float, rng: np.random.Generator) -> np.ndarray:
    """Frequency up and down between 0.1 Hz and the highest, in equal times an octave, of any phase; up to 1."""
    half = rng.uniform(0.35, 0.65) * SECONDS
    rate = np.log(most_hz / SLOWEST_HZ)
    up = np.where(t < half, t / half, (SECONDS - t) / (SECONDS - half)).clip(0.0, 1.0)
    f = SLOWEST_HZ * np.exp(rate * up)
    phase = 2.0 * np.pi * np.cumsum(f) * (t[1] - t[0]) + rng.uniform(0.0, 2.0 * np.pi)
    return np.sin(phase) / np.maximum(1.0, f / corner)


def _sines(t: np.ndarray, most_hz: float, corner: float, rng: np.random.Generator) -> np.ndarray:
    """Seven sines, frequencies spread over the octaves; rms 0.5."""
    f = SLOWEST_HZ * np.exp(np.log(most_hz / SLOWEST_HZ) * (np.arange(7) + rng.uniform(0.0, 1.0, 7)) / 7.0)
    size = 1.0 / np.maximum(1.0, f / corner)
    phase = rng.uniform(0.0, 2.0 * np.pi, 7)
    own = (size * np.sin(2.0 * np.pi * t[:, None] * f + phase)).sum(axis=1)
    return own * 0.5 / np.sqrt(0.5 * (size**2).sum())


def _steps(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Levels that last 0.4 to 1.6 s; up to 0.9."""
    edges = np.cumsum(rng.uniform(0.4, 1.6, 100))
    return rng.uniform(-0.9, 0.9, 101)[np.searchsorted(edges, t)]


def wished(name: str, kind: Kind, which: str, t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Positions that are wished at times ``t`` [s] from 0 to 30 in even steps, shape (n, J) [rad].

    Args:
        name: ``leg`` or ``arm``.
        kind: the machine.
        which: ``fit_0`` (chirps), ``fit_1`` (sines, then sines and steps) or ``held_out`` (steps, then sines).
        t: times.
        rng: of phases, frequencies and levels.
    """
    corner, out = CORNER_HZ[name], []
    for _ in kind.joints:
        if which == "fit_0":
            own = _chirp(t, kind.most_hz, corner, rng)
        else:
            sines, steps = _sines(t, kind.most_hz, corner, rng), _steps(t, rng)
            early = t < 0.5 * SECONDS
            own = (
                np.where(early, sines, 0.5 * (sines + steps))
                if which == "fit_1"
                else np.where(early, 0.8 * steps, 0.9 * sines)
            )
        out.append(own)
    begin = np.clip(t / 0.5, 0.0, 1.0)[:, None]  # from the pose that it rests in
    return kind.rest + begin * kind.reach * np.column_stack(out).clip(-1.0, 1.0)


def held(times: np.ndarray, rate_hz: float, command_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Rows of a log at which a new command is sent, as the row whose command holds at each row, shape (n,).

    A command lasts 1 / ``command_hz`` in the median, a quarter to three times of it, in whole rows.
    """
    typical = rate_hz / command_hz
    if typical <= 1.0:
        return np.arange(len(times))
    lasts = typical * np.exp(0.35 * rng.standard_normal(len(times)))
    starts = np.concatenate(
        ([0], np.cumsum(np.maximum(1, np.round(lasts.clip(0.25 * typical, 3.0 * typical)))))
    )
    starts = starts[starts < len(times)].astype(int)
    return starts[np.searchsorted(starts, np.arange(len(times)), side="right") - 1]
