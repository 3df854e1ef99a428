"""Pushes on the last link as causes of a problem of joint logs: proposals, variants and columns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import fftconvolve

from discrepancy.evidence.cells import Cells, Series
from discrepancy.evidence.posterior import Group, Posterior
from estimator.arrays import Array

PUSH_S = (0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6, 2.4)
PUSH_N, PUSH_BAND_HZ, EVENTS = 30.0, 1.5, 6
"""Pushes: durations to try [s], prior force [N], frequency of the noise for ranking [Hz], number of proposals."""
BEGIN_S = 1.0
"""Earliest start of a push [s]. Free vibration at the start of a log looks like a push."""


class Pushes:
    """The part of a linear problem that looks for pushes; attributes are those of ``JointProblem``."""

    cells: Cells
    channel: Mapping[int, int]
    pushed: list[Array]
    changed: int | None

    def rows(self, series: Sequence[Series]) -> list[Series]:
        """Convert columns from joints to channels. Joints without torques have no channel."""
        return [{self.channel[j]: x for j, x in by.items() if j in self.channel} for by in series]

    def proposals(self, posterior: Posterior, *, late: bool = False) -> list[Group]:
        """Find the likeliest push for each duration: a half-sine force on the last link along the world axes."""
        scores = self.cells.weighted_residual(posterior.mean, posterior.variance)
        middle = int(np.searchsorted(self.cells.bands.edges_hz, PUSH_BAND_HZ)) - 1
        weight = 1.0 / posterior.variance[:, middle]
        found, windows = [], 0
        for t, score in enumerate(scores[: self.changed] if self.pushed else ()):
            force, rate = self.pushed[t][:, list(self.channel)], self.cells.bands.rates_hz[t]
            Q = np.einsum("wck,wc->wk", force, score)
            R = np.einsum("wck,wcl,c->wkl", force, force, weight)
            ridge = 1e-9 * np.trace(R.sum(axis=0)) * np.eye(3)
            for seconds in PUSH_S:
                n = round(seconds * rate)
                if n < 3 or max(4 * n, n + BEGIN_S * rate) > len(score):
                    continue
                sine = np.sin(np.pi * (np.arange(n) + 0.5) / n)
                q = fftconvolve(Q, sine[:, None], mode="valid", axes=0)
                r = fftconvolve(R, (sine**2)[:, None, None], mode="valid", axes=0) + ridge
                gain = 0.5 * np.einsum("wk,wk->w", q, np.linalg.solve(r, q[..., None])[..., 0])
                gain[: round(BEGIN_S * rate)] = 0.0
                windows += len(gain) * 4 // n
                best = int(np.argmax(gain))
                found.append((float(gain[best]), t, best, n))
        return [
            self._window(t, first, n, -math.log(windows))
            for _, t, first, n in sorted(found, reverse=True)[:EVENTS]
        ]

    def _window(self, trial: int, first: int, n: int, log_prior: float) -> Group:
        rate = self.cells.bands.rates_hz[trial]
        shape = (("trial", float(trial)), ("start_s", first / rate), ("duration_s", n / rate))
        place = f"last link from {first / rate:.1f} s of log {trial + 1}"
        return Group("push", place, (), (PUSH_N,) * 3, log_prior, shape, event=True)

    def place(self, group: Group) -> Group:
        """Add the columns of a push: a half-sine force along each world axis."""
        columns = self.cells.add(self.rows([self.push(group, np.eye(3)[k], 1) for k in range(3)]))
        return replace(group, columns=tuple(columns))

    def nearby(self, group: Group, posterior: Posterior) -> list[Group]:
        """Variants of a push: slightly earlier, later, shorter and longer."""
        if not group.event:
            return []
        shape = dict(group.shape)
        trial = int(shape["trial"])
        rate, most = self.cells.bands.rates_hz[trial], len(self.pushed[trial])
        middle, n = (shape["start_s"] + 0.5 * shape["duration_s"]) * rate, shape["duration_s"] * rate
        out = []
        shifts = ((-0.15, 1.0), (0.15, 1.0), (0.0, 0.75), (0.0, 1.33), (-0.15, 1.33), (0.15, 1.33))
        for shift, stretch in shifts:
            length = round(stretch * n)
            first = round(middle + shift * n - 0.5 * length)
            if length > 2 and first >= BEGIN_S * rate and first + length <= most:
                out.append(self._window(trial, first, length, group.log_prior))
        return out

    def push(self, group: Group, force: Array, wave: int) -> Series:
        """Torques of a push whose force profile has ``wave`` half sines."""
        shape = dict(group.shape)
        trial = int(shape["trial"])
        rate = self.cells.bands.rates_hz[trial]
        first, n = round(shape["start_s"] * rate), round(shape["duration_s"] * rate)
        window = np.sin(wave * np.pi * (np.arange(n) + 0.5) / n)
        by: dict[int, list[Array]] = {}
        for c in range(self.pushed[trial].shape[1]):
            by[c] = [np.zeros(len(f)) for f in self.pushed]
            by[c][trial][first : first + n] = -(self.pushed[trial][first : first + n, c] @ force) * window
        return by
