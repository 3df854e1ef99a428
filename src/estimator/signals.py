"""Compute the data points of a recording (paper, sections II and IV.B), and find its static holds.

In a hold the payload does not move and forces stay constant. The paper takes data "when the measured forces along all
axes remained constant (with a tolerance of 0.01 N) for a continuous duration of six seconds". With torque noise of
0.01 N m the filtered forces still scatter by 0.016 N rms, so the bare criterion is never met. Here a window of six
seconds is part of a hold if

* every force component stays within +-(0.01 N + 5 sigma) of its mid-range. sigma is the component's noise in the
  window, from its second differences over 0.1 s (insensitive to drift and slow motion), as the median over half
  seconds (insensitive to a jump);
* its running mean over 1 s stays within +-(0.01 N + 4 sigma_1s), with sigma_1s = sigma sqrt(0.1 / 1) for noise below 5
  Hz. This detects a drift below the noise of single samples;
* the encoders show a payload at rest: wrist speed and angular velocity below 5 mm/s and 0.02 rad/s rms. This rejects
  fast vibration, which a difference over 0.1 s would take for noise.

Without noise sigma is 0 and the first rule is the paper's criterion. With noise a hold may include some of the motion
before and after it, so means exclude half a second at either end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from estimator import so3
from estimator.arm.motion import arm_data
from estimator.arm.unit import Arms, levelled
from estimator.arrays import Array, apart
from estimator.errors import InputError
from estimator.filtering import differentiate, low_pass, trim_slice
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.model import Recording


@dataclass(frozen=True)
class GraspData:
    """Data points D_iq = {T_bi, V_i, dV_i/dt, F_i} (paper, section II) of Q samples and N robots.

    {b} is each robot's own base frame (the paper's {i0} up to a constant), of driving bases that at the start; {i} is
    its grasp frame on the payload side of the gimbal. Twists and wrenches list the angular part first, as in the paper.

    Attributes:
        time: sample times [s], shape (Q,).
        R_bi: orientation g(theta) of {i} in {b}, shape (Q, N, 3, 3).
        p_bi: wrist position h(phi) in {b} [m], shape (Q, N, 3).
        twist: body twist (omega_i [rad/s], v_i [m/s]) in {i}, equation (29), shape (Q, N, 6).
        twist_dot: component-wise time derivative of ``twist`` (v-dot, not the acceleration), shape (Q, N, 6).
        wrench: wrench (m_i [N m], f_i [N]) of robot i ON the payload at the origin of {i}, in {i},
            shape (Q, N, 6).
        rate_hz: sampling rate [Hz].
        gravity_mps2: magnitude of gravity, along -z of every base frame [m/s^2].
    """

    time: Array
    R_bi: Array
    p_bi: Array
    twist: Array
    twist_dot: Array
    wrench: Array
    rate_hz: float
    gravity_mps2: float

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.twist.shape[1]

    @property
    def samples(self) -> int:
        """Number of samples Q."""
        return self.twist.shape[0]

    def at(self, kept: NDArray[np.bool_] | slice) -> GraspData:
        """Return some of the samples, selected by a mask or slice of shape (Q,)."""
        names = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

    def every(self, stride: int) -> GraspData:
        """Return every ``stride``-th sample."""
        return replace(self.at(slice(None, None, stride)), rate_hz=self.rate_hz / stride)


BLOCK = 16_384
"""Number of samples of one robot that are converted at a time; the result does not depend on it."""


def process_recording(recording: Recording, cutoff_hz: float = 5.0, trim_s: float = 2.0) -> GraspData:
    """Filter, differentiate and convert a recording to poses, twists, twist derivatives and wrenches.

    If the metadata contain the robots' deviations, readings are corrected. Joint angles and torques pass through the
    same zero-phase filter. Rates and accelerations come from sixth-order differences of the *joint* angles. The twist
    (29), its derivative and the wrench then follow analytically.

    Args:
        recording: one trial.
        cutoff_hz: cut-off of the Butterworth filter [Hz], at least 1/trim_s. Transients decay as exp(-pi cutoff t), so
            with a lower cut-off they would remain after trim_s.
        trim_s: time dropped at each end because of filter transients [s].

    Raises:
        InputError: the recording is not usable (see ``check_recording``), or an option is out of range.
    """
    check_recording(recording)
    check_duration(recording, trim_s)
    if cutoff_hz > 0.0 and 0.0 < cutoff_hz * trim_s < 1.0:
        raise InputError(
            f"cutoff_hz is {cutoff_hz!r}; with {trim_s:g} s dropped at each end it must be at least "
            f"{1.0 / trim_s:g} Hz, or the filter's transients remain"
        )
    rate_hz = recording.metadata.rate_hz
    keep = trim_slice(len(recording.time), rate_hz, trim_s)
    time = recording.time[keep]
    shape = len(time), recording.metadata.robots
    sizes = {"R_bi": (3, 3), "p_bi": (3,), "twist": (6,), "twist_dot": (6,), "wrench": (6,)}
    empty = {name: np.empty((*shape, *size)) for name, size in sizes.items()}
    data = GraspData(time, **empty, rate_hz=rate_hz, gravity_mps2=recording.metadata.design.gravity_mps2)
    for robot in range(shape[1]):
        arm = recording.arm(robot)
        read = low_pass(np.concatenate(recording.joints(robot), axis=1), rate_hz, cutoff_hz)
        motion, tau = _derivatives(read[:, :6], rate_hz, keep), apart(read[keep, 6:], 1)
        base = None
        if recording.base is not None:
            path = _derivatives(low_pass(recording.base[:, robot], rate_hz, cutoff_hz), rate_hz, keep)
            base = np.concatenate(path, axis=-1)
        # Convert in blocks: intermediate results take ten times the memory of the final ones.
        for first in range(0, len(time), BLOCK):
            block = slice(first, first + BLOCK)
            phi, theta = motion[:, block, :3], motion[:, block, 3:]
            _fill(data, robot, block, phi, theta, tau[block], arm, None if base is None else base[block])
    return data


def _derivatives(angles: Array, rate_hz: float, keep: slice) -> Array:
    """Return angles [rad], rates and accelerations of the kept samples, shape (3, q, 6)."""
    rate = differentiate(angles, rate_hz)
    return apart(np.stack([angles[keep], rate[keep], differentiate(rate, rate_hz)[keep]]), 1)


def _fill(
    data: GraspData,
    robot: int,
    block: slice,
    phi: Array,
    theta: Array,
    tau: Array,
    arm: Arms,
    base: Array | None,
) -> None:
    """Store data points of one robot from its angles with derivatives, (3, q, 3), torques, (q, 3), and base (q, 9)."""
    found = arm_data((phi[0], phi[1], phi[2]), (theta[0], theta[1], theta[2]), tau, arm, base)
    data.R_bi[block, robot], data.p_bi[block, robot] = levelled(arm, found.R_bi, found.h)
    data.twist[block, robot], data.twist_dot[block, robot] = found.twist, found.twist_dot
    data.wrench[block, robot] = found.wrench


TOLERANCE_N = 0.01
"""Largest distance of a noise-free force component from its mid-range in a window."""
DURATION_S = 6.0
"""Length of the window, and the shortest hold."""
STILL_SPEED_MPS = 5e-3
STILL_RATE_RADPS = 2e-2
_SIGMAS = 5.0
_SLOW_SIGMAS = 4.0  # lower, because a window has fewer independent values, and to detect drift
_LAG_S = 0.1  # noise below 5 Hz is uncorrelated after this time
_SMOOTH_S = 1.0
BATCH_S = 0.5
_MARGIN_S = 0.5


@dataclass(frozen=True)
class Hold:
    """Mean orientation R_bi (N, 3, 3) and wrench (m_i, f_i) in {i} (N, 6) of one static hold.

    Attributes:
        start_s, end_s: first and last sample time of the hold [s].
        batches: means of the wrench over consecutive half seconds, shape (batches, N, 6); their scatter is the
            measurement noise within the hold.
        rounding_N2: variance of each component of a robot's mean force due to rounding [N^2].
    """

    start_s: float
    end_s: float
    R_bi: Array
    wrench: Array
    batches: Array
    rounding_N2: float = 0.0

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.wrench)


def find_holds(data: GraspData) -> list[Hold]:
    """Find all static holds of a trial, in order of time."""
    window = round(DURATION_S * data.rate_hz) + 1
    Q = data.samples
    if window > Q or window < 3:
        return []
    steady = np.ones(Q - window + 1, dtype=bool)
    for robot in range(data.robots):  # one at a time to save memory
        steady &= _rests(data, robot, window)
    starts = np.flatnonzero(steady)
    if not len(starts):
        return []
    runs = np.split(starts, np.flatnonzero(np.diff(starts) > 1) + 1)
    holds: list[tuple[int, int]] = []
    for run in runs:
        first, last = int(run[0]), int(run[-1]) + window
        if holds and first < holds[-1][1]:  # overlapping windows of one hold, with a rejected one in between
            first = holds.pop()[0]
        holds.append((first, last))
    return [_hold(data, first, last) for first, last in holds]


def _rests(data: GraspData, robot: int, window: int) -> NDArray[np.bool_]:
    """Return whether one robot's forces are constant and its grasp is still, per window; shape (Q - window + 1,)."""
    force = np.einsum("qab,qb->qa", data.R_bi[:, robot], data.wrench[:, robot, 3:])
    variance = _noise_variance(force, data.rate_hz, window)  # (windows, 3)
    smooth = uniform_filter1d(force, _odd(_SMOOTH_S * data.rate_hz), axis=0, mode="nearest")
    slow = variance * min(1.0, _LAG_S / _SMOOTH_S)

    steady = _half_range(force, window) <= TOLERANCE_N + _SIGMAS * np.sqrt(variance)
    # The running mean reaches half its length beyond the window, where the payload may already move.
    edge = min(_odd(_SMOOTH_S * data.rate_hz) // 2, (window - 1) // 2)
    inner = _half_range(smooth, window - 2 * edge)[edge : edge + len(steady)]
    steady &= inner <= TOLERANCE_N + _SLOW_SIGMAS * np.sqrt(slow)
    rests = steady.all(axis=1)
    for part, limit in ((slice(3, 6), STILL_SPEED_MPS), (slice(0, 3), STILL_RATE_RADPS)):
        square = np.sum(data.twist[:, robot, part] ** 2, axis=1, keepdims=True)
        rests &= np.sqrt(_window_mean(square, window))[:, 0] <= limit
    return rests


def _hold(data: GraspData, first: int, last: int) -> Hold:
    margin = min(round(_MARGIN_S * data.rate_hz), (last - first) // 4)
    inside = slice(first + margin, last - margin)
    wrench = data.wrench[inside]
    count = max(2, int(len(wrench) / (BATCH_S * data.rate_hz)))
    batches = np.array([part.mean(axis=0) for part in np.array_split(wrench, count)])
    R_bi = so3.chordal_mean(data.R_bi[inside])
    return Hold(float(data.time[first]), float(data.time[last - 1]), R_bi, wrench.mean(axis=0), batches)


def _noise_variance(force: Array, rate_hz: float, window: int) -> Array:
    """Return the variance of noise that is uncorrelated over the lag, per window, (Q - window + 1, components)."""
    lag = max(1, min(round(_LAG_S * rate_hz), (window - 1) // 2))
    second = force[2 * lag :] - 2 * force[lag:-lag] + force[: -2 * lag]
    length = window - 2 * lag
    piece = min(length, max(1, round(BATCH_S * rate_hz)))
    means = _window_mean(second**2, piece) / 6  # var(a - 2b + c) = 6 var
    starts = np.arange(0, length - piece + 1, piece)
    count = len(second) - length + 1
    # The median over half seconds ignores a jump and the start of a motion, which are not noise.
    return np.median([means[start : start + count] for start in starts], axis=0)


def _window_mean(x: Array, window: int) -> Array:
    total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    return np.maximum(total[window:] - total[:-window], 0.0) / window


def _half_range(x: Array, window: int) -> Array:
    """Return half of max - min over every window, shape (Q - window + 1, components)."""
    ahead = -(window // 2)  # entry k is the window that starts at k
    high = maximum_filter1d(x, window, axis=0, origin=ahead)
    low = minimum_filter1d(x, window, axis=0, origin=ahead)
    return 0.5 * (high - low)[: len(x) - window + 1]


def _odd(x: float) -> int:
    return 2 * max(0, int(x / 2)) + 1
