"""A logger between the team and its recording: stamps that jitter and drift, robots out of step, samples lost.

What a real log does to samples before ``mocobot convert`` sees it. The truth is read at each robot's own instants,
noise and rounding are added there, and the stamps are those of its own clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from mocobot_logs.convert import Labels, convert
from mocobot_logs.log import CHANNELS, REF, Level, Samples
from mocobot_logs.resample import RATE_HZ as CONVERTED_HZ
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.trial_log import TrialLog

Array = NDArray[np.float64]

RATES_HZ = (50.0, 80.0, 100.0, 125.0, 200.0, 250.0, 400.0, 500.0, 1000.0)
LEAST_SPACING = 0.05
"""Share of a period that two samples are apart at least, however large the jitter."""


@dataclass(frozen=True, eq=False)
class MadeLog:
    """A log in memory; attributes as in ``LogSource``."""

    name: str
    streams: tuple[Samples, ...]
    level: Level = "joint"
    channels: tuple[str, ...] = (*CHANNELS["joint"], *REF)
    metadata: RecordingMetadata | None = None

    @property
    def robots(self) -> int:
        return len(self.streams)

    @property
    def size(self) -> int:
        return len(self.streams)

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Every robot's samples."""
        for robot, stream in enumerate(self.streams):
            yield robot, stream
            advance(1)


@dataclass(frozen=True)
class Logger:
    """How a team is recorded.

    Attributes:
        rate_hz: samples a second [Hz].
        jitter_s: standard deviation of the instants at which samples are taken; the stamps tell them [s].
        drops: share of samples that are lost, each by itself.
        stagger_s: how much later each robot begins a period than the one before [s].
        offset_s, drift: by which each robot's clock differs from the one before, at the start [s] and by its rate.
        encoder_bits: resolution of every encoder, per turn; None for continuous.
        tau_noise_Nm: standard deviation of white torque noise before rounding [N m].
        tau_step_Nm: torque resolution [N m]; 0 for continuous.
        converted_hz: sampling rate of the recording that ``mocobot convert`` is asked for.
    """

    rate_hz: float = 100.0
    jitter_s: float = 0.0
    drops: float = 0.0
    stagger_s: float = 0.0
    offset_s: float = 0.0
    drift: float = 0.0
    encoder_bits: int | None = 16
    tau_noise_Nm: float = 0.01
    tau_step_Nm: float = 0.01
    converted_hz: float = CONVERTED_HZ

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Logger:
        """Any logger that a lab may have."""
        rate_hz = float(rng.choice(RATES_HZ))
        return cls(
            rate_hz=rate_hz,
            jitter_s=float(rng.choice([0.0, 1.0]) * np.exp(rng.uniform(np.log(5e-5), np.log(2e-3)))),
            drops=float(rng.choice([0.0, rng.uniform(0.0, 0.05)])),
            stagger_s=float(rng.choice([0.0, rng.uniform(0.0, 0.01)])),
            offset_s=float(rng.choice([0.0, rng.uniform(-0.05, 0.05)])),
            drift=float(rng.choice([0.0, rng.uniform(-5e-5, 5e-5)])),
            encoder_bits=int(rng.integers(12, 21)),
            tau_noise_Nm=float(np.exp(rng.uniform(np.log(0.003), np.log(0.05)))),
            tau_step_Nm=float(rng.choice([0.0, 0.001, 0.01, 0.02])),
        )

    def recorded(self, trial: TrialLog, rng: np.random.Generator, name: str = "logged") -> Recording:
        """A trial, logged and brought onto one grid as ``mocobot convert`` does it.

        Args:
            trial: what truly happened.
            rng: source of jitter, losses, noise and of where rounding grids lie.
            name: how messages call the log.
        """
        log = MadeLog(name, tuple(self._stream(trial, robot, rng) for robot in range(trial.robots)))
        labels = Labels(trial=trial.trial)
        correct = bool(self.offset_s or self.drift)
        converted = convert(log, labels, omnid_design(), rate_hz=self.converted_hz, correct=correct)
        recording = converted.recording
        control = trial.gains.to_dict() | {"feed_forward_N": trial.feed_forward.tolist()}
        return replace(recording, metadata=replace(recording.metadata, control=control))

    def _stream(self, trial: TrialLog, robot: int, rng: np.random.Generator) -> Samples:
        sensed, unit = trial.sensed, trial.units[robot]
        clock = np.arange(len(sensed.phi)) / sensed.rate_hz
        at = self._instants(clock[-1], robot, rng)
        clock_s = trial.sensors.of("clock_delay_s", trial.robots)[robot]
        torque_s = clock_s + trial.sensors.of("torque_delay_s", trial.robots)[robot]
        encoder = 2.0 * np.pi / 2**self.encoder_bits if self.encoder_bits else 0.0
        parts = []
        for values, delay_s, zero, noise, step in (
            (sensed.phi, clock_s, unit.phi_zero_rad, 0.0, encoder),
            (sensed.theta, clock_s, unit.theta_zero_rad, 0.0, encoder),
            (sensed.tau, torque_s, unit.tau_zero_Nm, self.tau_noise_Nm, self.tau_step_Nm),
        ):
            read = CubicSpline(clock, values[:, robot])(np.clip(at - delay_s, clock[0], clock[-1])) + zero
            read += noise * rng.standard_normal(read.shape)
            grid = step * rng.uniform(-0.5, 0.5, 3)
            parts.append(np.round((read + grid) / step) * step - grid if step else read)
        commands = CubicSpline(trial.time, trial.ref_b[:, robot], bc_type="clamped")
        parts.append(commands(np.minimum(at, trial.time[-1])))
        stamp = at * (1.0 + robot * self.drift) + robot * self.offset_s
        return Samples(np.rint((stamp + 1.0) * 1e9).astype(np.int64), np.concatenate(parts, axis=1))

    def _instants(self, end_s: float, robot: int, rng: np.random.Generator) -> Array:
        """When one robot's samples are taken [s]."""
        period = 1.0 / self.rate_hz
        at = np.arange((robot * self.stagger_s) % period, end_s, period)
        # A late sample does not change the place of the next, but samples stay in order.
        at = np.sort(at + self.jitter_s * rng.standard_normal(len(at))) if self.jitter_s else at
        at = at[np.concatenate([[True], np.diff(at) > LEAST_SPACING * period])]
        kept = rng.uniform(size=len(at)) >= self.drops
        kept[[0, -1]] = True
        return at[kept & (at >= 0) & (at <= end_s)]
