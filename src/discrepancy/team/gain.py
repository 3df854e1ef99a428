"""How far simulated responses to recorded commands are from recorded ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from estimator.arrays import Array

MARGIN_SHARE = 0.02
"""Simulations whose chi-square differs by less are equally good; so are all within the noise, at 1 and less. Chosen."""


@dataclass(frozen=True)
class Response:
    """How far one trial's response to its commands is from the simulated one.

    Attributes:
        rms: by channel, in the channel's unit.
        nrmse: by channel, over the standard deviation of the motion.
        chi2_per_n: mean square over the variance of sensor noise and integration error.
    """

    rms: Mapping[str, float]
    nrmse: Mapping[str, float]
    chi2_per_n: float

    @classmethod
    def of(cls, errors: Mapping[str, Array], scales: Mapping[str, tuple[Array, Array]]) -> Response:
        """From recorded minus simulated channels, and standard deviations of the noise and of the motion in each."""
        rms, nrmse, squares = {}, {}, []
        for name, error in errors.items():
            noise, motion = scales[name]
            rms[name] = float(np.sqrt(np.mean(error**2)))
            nrmse[name] = rms[name] / float(np.sqrt(np.mean(motion**2)))
            squares.append(np.mean((error / noise) ** 2))
        return cls(rms, nrmse, float(np.mean(squares)))


@dataclass(frozen=True)
class Gain:
    """Responses of every trial that can be simulated, without and with the causes, by what the other trials say.

    Attributes:
        before, after: one per trial; None where the simulation failed.
        held_out: False for a single trial, which predicts itself, and where a cause is there in some trials only, which
            all have to tell it.
        as_found: with the causes and every healthy part as far off as it is found, too; empty where that was not asked.
    """

    before: tuple[Response | None, ...]
    after: tuple[Response | None, ...]
    held_out: bool
    as_found: tuple[Response | None, ...] = ()

    @property
    def pairs(self) -> list[tuple[Response, Response]]:
        """Trials that were simulated both ways."""
        both = zip(self.before, self.after, strict=True)
        return [(a, b) for a, b in both if a is not None and b is not None]

    @property
    def is_better_as_found(self) -> bool:
        """Whether every trial can be simulated with all as found, and is told better so than with the causes alone."""
        return bool(self.as_found) and mean_chi2(self.as_found) < mean_chi2([b for _, b in self.pairs])

    def removed(self) -> tuple[float, float, float] | None:
        """Share of the excess error (root mean square over noise) removed: mean over trials, 95 % interval."""
        shares = [
            1.0 - _excess(b.chi2_per_n) / _excess(a.chi2_per_n) for a, b in self.pairs if a.chi2_per_n > 1.0
        ]
        if not shares:
            return None
        mean = float(np.mean(shares))
        if len(shares) < 2:
            return mean, float("-inf"), 1.0
        half = stdtrit(len(shares) - 1, 0.975) * np.std(shares, ddof=1) / np.sqrt(len(shares))
        return mean, mean - float(half), min(1.0, mean + float(half))


def _excess(chi2_per_n: float) -> float:
    return float(np.sqrt(max(chi2_per_n - 1.0, 0.0)))


def is_worse(chi2_per_n: float, than: float) -> bool:
    """Whether simulated responses are worse than others; within the noise (1) none is."""
    return chi2_per_n > max(than, 1.0) * (1.0 + MARGIN_SHARE)


def mean_chi2(trials: Sequence[Response | None]) -> float:
    """Mean chi-square per number; infinite where a trial could not be simulated."""
    return float(np.mean([np.inf if r is None else r.chi2_per_n for r in trials]))
