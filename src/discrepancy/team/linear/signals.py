"""Joint signals of one trial: as measured, and low-pass filtered with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from estimator.arm.unit import true_joints
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass, trim_slice
from estimator.quantisation import without_held
from estimator.recording.metadata import Sampling
from estimator.recording.model import Recording

TEAM_SMOOTH_HZ = 12.0
"""Cut-off of signals whose rounding is drawn again, and of rates that separate rest from sliding [Hz]. Chosen."""

TEAM_TRIM_S = 2.0
"""Time left out at both ends of a recording [s]. Chosen."""

TEAM_PRE_HZ = 20.0
"""Cut-off before the nonlinear formulas [Hz]. Derived: filter and formulas commute to within the noise."""


@dataclass(frozen=True, eq=False)
class Signals:
    """Joint signals of one trial of N robots, at the recording's rate and full length.

    Attributes:
        time: [s], shape (Q,).
        phi, theta, tau: recorded signals, corrected by the robots' calibration and by causes, shape (Q, N, 3).
        rate_hz: sampling rate [Hz].
        sampling: how each robot's sensors were read, if the samples were resampled.
        smooth_hz: cut-off of rates that separate rest from sliding, shape (3, N, 3): phi, theta, tau; None: the
            default.
        pre_hz: cut-off before the nonlinear formulas. It lies above any chatter, because the mean of a product is not
            the product of the means.
        doubt: possible error of interpolated readings over the rounding error, shape (Q,); None if no reading was held.
        base: measured poses of driving bases, as in ``Recording``, shape (Q, N, 3); None for bases that stand.
    """

    time: Array
    phi: Array
    theta: Array
    tau: Array
    rate_hz: float
    sampling: tuple[Sampling, ...] | None = None
    smooth_hz: Array | None = None
    pre_hz: float = TEAM_PRE_HZ
    doubt: Array | None = None
    base: Array | None = None
    _last: dict[tuple[str, int, int], Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, recording: Recording) -> Signals:
        """Take the signals of a recording, and convert them to true joint values if the robots are calibrated.

        Where an encoder holds its value, the signals are interpolated.
        """
        recording, held, doubt = without_held(recording)
        known = recording.metadata
        signals = true_joints(known.arms, recording.phi, recording.theta, recording.tau)
        doubts, base = doubt if held else None, recording.base
        return cls(recording.time, *signals, known.rate_hz, known.sampling, doubt=doubts, base=base)

    def minus(
        self, phi: Array | float = 0.0, theta: Array | float = 0.0, tau: Array | float = 0.0
    ) -> Signals:
        """Subtract sensor errors from the signals."""
        return replace(self, phi=self.phi - phi, theta=self.theta - theta, tau=self.tau - tau)

    def smooth(self, moves: Literal["phi", "theta", "tau"], robot: int, joint: int) -> Array:
        """Filter one joint's signal so that its rate separates rest from sliding, shape (Q,)."""
        usual, kind = TEAM_SMOOTH_HZ, ("phi", "theta", "tau").index(moves)
        cutoff_hz = usual if self.smooth_hz is None else float(self.smooth_hz[kind, robot, joint])
        which = moves, robot, joint
        if which not in self._last:  # successive shapes of a cause ask for the same signal
            self._last.clear()
            self._last[which] = low_pass(getattr(self, moves)[:, robot, joint], self.rate_hz, cutoff_hz)
        return self._last[which]

    def with_rates(self, x: Array) -> Array:
        """Filtered value, rate and acceleration of samples, shape (Q, ...) -> (3, Q, ...)."""
        value = low_pass(x, self.rate_hz, self.pre_hz)
        rate = differentiate(value, self.rate_hz)
        return np.stack([value, rate, differentiate(rate, self.rate_hz)])

    @property
    def chatters(self) -> bool:
        """Whether the signals oscillate above the usual cut-off ``TEAM_PRE_HZ``."""
        return self.pre_hz > TEAM_PRE_HZ

    @property
    def keep(self) -> slice:
        """Samples without the filters' transients at both ends."""
        return trim_slice(len(self.time), self.rate_hz, TEAM_TRIM_S)
