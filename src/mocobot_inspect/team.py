"""Inspect a team's log: stamps, channels, clocks, wiring and excitation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from estimator.arm.delta import joints_of, wrist_fault
from estimator.arm.design import OmnidDesign
from estimator.arm.unit import Arms, ArmUnit, design_of
from estimator.arrays import Array
from estimator.clocks import ClockEstimate, estimate_clocks
from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import estimate_from_trials
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.uncertainty import FACTOR, StepReport
from estimator.filtering import differentiate, low_pass
from estimator.recording.metadata import FREE, RecordingMetadata
from estimator.recording.model import Recording
from estimator.signals import DURATION_S, STILL_RATE_RADPS, STILL_SPEED_MPS, GraspData, process_recording
from mocobot_inspect.channels import Channel, seconds, wild
from mocobot_inspect.signals import CUTOFF_HZ, KINDS, RATE_HZ, TRIM_S, of_arrays, signals_of
from mocobot_inspect.survey import Survey, Timing, survey
from mocobot_inspect.team_wiring import Wiring, check_wiring
from mocobot_logs.log import NS, THETA, Level, LogSource, Samples

QUANTITIES = ("grasps", "mass", "centre of mass", "inertia")
AXES = ("roll", "pitch", "yaw")  # rotation about x, y and z of {1}
_HARDLY = 0.1  # of the rotation about the axis with most motion
_ALONG = np.cos(np.deg2rad(20.0))


@dataclass(frozen=True)
class Readiness:
    steps: tuple[StepReport, ...]  # excitation of every step of the estimate
    holds: int  # number of static holds
    axes: tuple[float, float, float] | None  # angular velocity about x, y, z of {1} [rad/s rms], or None
    reasons: dict[str, str | None]  # why each of ``QUANTITIES`` cannot be estimated, None if it can
    flags: tuple[str, ...]  # warnings of the estimate itself


def readiness(name: str, level: Level, parts: Sequence[tuple[float, Array]], arms: Arms) -> Readiness:
    """Run the estimate on uniform stretches, each a start [s] and samples (q, N, 9) at 100 Hz, and report its steps."""
    try:
        with np.errstate(over="raise", divide="raise"):
            data = [
                _processed(f"{name} from {start:.1f} s", level, part, start, arms) for start, part in parts
            ]
            trials = [Trial(f"stretch {k + 1}", "random", None, d) for k, d in enumerate(data)]
            estimate = estimate_from_trials(trials)
    except (InputError, FloatingPointError, np.linalg.LinAlgError) as error:
        reason = str(error) if isinstance(error, InputError) else f"the equations cannot be solved ({error})"
        return Readiness((), 0, None, dict.fromkeys(QUANTITIES, reason), ())
    omega = np.concatenate([d.twist[:, 0, :3] for d in data])
    x, y, z = (float(rate) for rate in np.sqrt(np.mean(omega**2, axis=0)))
    holds = sum(recording.holds for recording in estimate.recordings)
    return Readiness(estimate.steps, holds, (x, y, z), _reasons(estimate, omega), estimate.flags)


def _processed(name: str, level: Level, part: Array, start_s: float, arms: Arms) -> GraspData:
    design, units = design_of(arms), arms if isinstance(arms, ArmUnit) else None
    position, theta, effort = np.split(part, 3, axis=2)
    if level == "wrist":
        fault = wrist_fault(position, design)
        if fault is not None:
            (row, robot), what = fault
            raise InputError(f"omnid{robot + 1}, {start_s + row / RATE_HZ:.2f} s: {what}")
        position, effort = joints_of(position, effort, design)
    metadata = RecordingMetadata(
        part.shape[1], RATE_HZ, "random", "inspection", None, None, design, units=units
    )
    time = start_s + np.arange(len(part)) / RATE_HZ
    return process_recording(
        Recording(time, position, theta, effort, None, metadata, name), CUTOFF_HZ, TRIM_S
    )


def _reasons(estimate: PayloadEstimate, omega: Array) -> dict[str, str | None]:
    """Return why each of ``QUANTITIES`` cannot be estimated, None if it can."""
    grasps = estimate.grasps is not None
    weak = [direction for step in estimate.steps for direction in step.weak]
    turning = (step.noise for step in estimate.steps if step.step.startswith("rotation"))
    idle = idle_axes(omega, max(turning, default=0.0))

    def why(*words: str) -> str:
        if idle:
            return " and ".join(idle) + " not excited"
        own = [direction for direction in weak if any(word in direction.step for word in words)]
        for direction in own or weak:
            return f"{direction.direction}: {direction.reason}"
        return "nothing moves, and there is no static hold"

    return {
        "grasps": None if grasps else why("rotation", "position"),
        "mass": None if estimate.mass is not None else why("mass"),
        **{
            name: None if value is not None else why(name) if grasps else "it needs the grasps"
            for name, value in (("centre of mass", estimate.p_1c), ("inertia", estimate.inertia))
        },
    }


def idle_axes(omega: Array, noise: float) -> list[str]:
    """Return the axes of {1} about which there is hardly any rotation, in words; oblique axes are left out.

    Angular velocities (Q, 3) are in {1} [rad/s], their noise is rms.
    """
    values, vectors = np.linalg.eigh(omega.T @ omega / len(omega))
    rates = np.sqrt(np.maximum(values, 0.0))
    idle = []
    for rate, axis in zip(rates, vectors.T, strict=True):
        k = int(np.argmax(np.abs(axis)))
        if rate <= max(FACTOR * noise, _HARDLY * rates[-1]) and abs(axis[k]) > _ALONG:
            idle.append(AXES[k])
    return idle


SLOWEST_HZ, FASTEST_HZ = 10.0, 20_000.0  # slowest and fastest plausible sample rate of a robot [Hz]
OFFSET_S = 2e-4  # smallest offset of a clock that is reported [s]; it must also exceed five standard errors
SIGMAS = 5.0
MOSTLY = 0.5  # share of the log above which a constant channel is faulty as a whole
MAX_GAP_S = 0.05
SHORTEST_S = 2 * TRIM_S + 2.0
WINDOW_S = 0.5
_PERIODS = 3.5  # median intervals: a longer one is a gap in a slow log
_LEAST_NOISE = 1e-9
"""Smallest noise of a channel [rad, m, N m, N], so that rounding errors of a still robot do not count as motion."""


@dataclass(frozen=True)
class Segments:
    """Rest and motion.

    Attributes:
        still_s, moving_s: time at rest and in motion [s].
        rests: stretches of rest long enough for a static hold (start, duration) [s].
    """

    still_s: float
    moving_s: float
    rests: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Standing:
    """A channel that is stuck or clipped at times."""

    channel: str  # its name, robot included
    seconds: float  # total duration [s]
    mostly: bool  # whether it lasts for at least ``MOSTLY`` of the log


@dataclass(frozen=True, eq=False)
class Inspection:
    """Results of the inspection of a log.

    Attributes:
        name, level, robots, channel_names: properties of the log.
        assumed_design: whether the log lacks the robots' design, so that one was assumed.
        design: the robots' design.
        survey: stamps and channels of every robot.
        checked: checked stretches: start after the log's first stamp and duration [s].
        unchecked: why motion and forces were not checked, or None.
        clocks: clocks of the robots, or None.
        skewed: whether the clocks differ; all results below are then corrected for that.
        segments: rest and motion, or None.
        wiring: suspected mistakes, or None.
        ready: what the log is ready for as it is, or None.
        ready_undone: the same with all found mistakes undone, or None if there are none.
        units: the robots as calibrated, or None.
        free: whether the robots hold nothing; then ``clocks``, ``wiring`` and ``ready`` are None.
    """

    name: str
    level: Level
    robots: int
    channel_names: tuple[str, ...]
    assumed_design: bool
    design: OmnidDesign
    survey: Survey
    checked: tuple[tuple[float, float], ...] = ()
    unchecked: str | None = None
    clocks: ClockEstimate | None = None
    skewed: bool = False
    segments: Segments | None = None
    wiring: Wiring | None = None
    ready: Readiness | None = None
    ready_undone: Readiness | None = None
    units: ArmUnit | None = None
    free: bool = False

    @property
    def arms(self) -> Arms:
        """The robots as calibrated, or else as designed."""
        return self.design if self.units is None else self.units

    @property
    def standing(self) -> tuple[Standing, ...]:
        """Channels that are stuck or clipped at times; each spoils an estimate from the log as it is."""
        found = []
        for robot, channels in enumerate(self.survey.channels):
            least_s = MOSTLY * self.survey.timing[robot].duration_s
            for c in channels:
                stuck_s, clipped_s = (sum(s.duration_s for s in every) for every in (c.stuck, c.clipped))
                if stuck_s or clipped_s:
                    mostly = max(stuck_s, clipped_s) >= least_s
                    found.append(Standing(f"omnid{robot + 1}.{c.name}", stuck_s + clipped_s, mostly))
        return tuple(found)


def inspect_log(
    source: LogSource,
    design: OmnidDesign,
    advance: Callable[[int], object] = lambda _: None,
    try_advance: Callable[[int], object] = lambda _: None,
    trial: str | None = None,
    units: ArmUnit | None = None,
) -> Inspection:
    """Inspect a log; faulty samples are reported, not refused.

    Args:
        source: the log.
        design: the robots' design, used if the log has none.
        advance: called with the reading progress, in the source's units.
        try_advance: called with the number of wiring mistakes tried.
        trial: kind of trial, used if the log does not state it.
        units: the robots as calibrated; None to use those of the log.
    """
    said = source.metadata
    seen = survey(source, advance)
    free = (said.trial if said is not None else trial) == FREE
    if free:
        # Without a payload nothing turns the gimbals, so constant ones are no finding.
        seen = replace(
            seen,
            channels=tuple(
                tuple(replace(c, stuck=(), stuck_count=0) if c.name in THETA else c for c in of_robot)
                for of_robot in seen.channels
            ),
        )
    result = Inspection(
        name=source.name,
        level=source.level,
        robots=source.robots,
        channel_names=source.channels,
        assumed_design=said is None,
        design=design if said is None else said.design,
        survey=seen,
        units=said.units if units is None and said is not None else units,
        free=free,
    )
    for robot, timing in enumerate(seen.timing):
        if timing.rate_hz is None:
            return replace(result, unchecked=f"robot {robot + 1} has too few samples")
        if not SLOWEST_HZ <= timing.rate_hz <= FASTEST_HZ:
            return replace(result, unchecked=f"robot {robot + 1} is sampled at {timing.rate_hz:.3g} Hz")
    streams = [
        clean_stream(samples, seen.origin_ns, _faulty(channels, timing))
        for samples, channels, timing in zip(seen.excerpt, seen.channels, seen.timing, strict=True)
    ]
    return _with_motion(result, streams, try_advance)


def _faulty(channels: tuple[Channel, ...], timing: Timing) -> list[tuple[int, int]]:
    """Return intervals of stamps in which a channel is stuck or clipped [ns], except channels that mostly are."""
    assert timing.first_ns is not None
    found = []
    for every in (stretches for c in channels for stretches in (c.stuck, c.clipped)):
        if sum(s.duration_s for s in every) < MOSTLY * timing.duration_s:
            starts = [timing.first_ns + round(s.start_s / NS) for s in every]
            found += [(a, a + round(s.duration_s / NS)) for a, s in zip(starts, every, strict=True)]
    return found


def _with_motion(
    result: Inspection, streams: list[tuple[Array, Array]], advance: Callable[[int], object]
) -> Inspection:
    """Add clocks, wiring and readiness from uniform stretches."""
    parts = stretches(streams)
    clocks = None if result.free else _clocks(parts)
    skewed = clocks is not None and any(differs(clocks, robot) for robot in range(1, result.robots))
    if skewed:
        parts = stretches(streams, clocks) or parts
    if not parts:
        return replace(
            result,
            unchecked=f"the robots share no {SHORTEST_S:g} s of samples that can be used, without a gap",
        )
    result = replace(
        result,
        checked=tuple((start, len(part) / RATE_HZ) for start, part in parts),
        segments=segments(result.level, parts, result.design),
    )
    if result.free:
        return result
    noise = np.array([[c.white_noise for c in of_robot[:9]] for of_robot in result.survey.channels])
    signals = signals_of(result.level, [part for _, part in parts], np.maximum(noise, _LEAST_NOISE))
    wiring = check_wiring(signals, result.arms, advance)
    undone = None
    if wiring.found:
        right = [(start, _undone(part, wiring, result.level)) for start, part in parts]
        undone = readiness(result.name, result.level, right, result.arms)
        if clocks is not None and not clocks.determined:
            clocks = _known(clocks, _clocks(right))
    return replace(
        result,
        clocks=clocks,
        skewed=skewed,
        wiring=wiring,
        ready=readiness(result.name, result.level, parts, result.arms),
        ready_undone=undone,
    )


def _undone(part: Array, wiring: Wiring, level: Level) -> Array:
    """Return the samples with all mistakes undone, shape (q, N, 9)."""
    signals = of_arrays(level, part[None], np.zeros(part.shape[1:]))
    for found in wiring.found:
        signals = found.mistake.undo(signals)
    return np.concatenate([signals.group(kind).values[0] for kind in KINDS], axis=2)


# Uniform stretches. Unlike ``mocobot_logs.resample``, nothing is refused: rows that are not finite or go back in time
# are left out, gaps split the log, and short stretches are skipped.


def clean_stream(
    samples: Samples, origin_ns: int, faulty: Sequence[tuple[int, int]] = ()
) -> tuple[Array, Array]:
    """Return one robot's usable samples: times after ``origin_ns`` [s], shape (q,), and nine channels (q, 9).

    They are averaged if they come faster than 100 Hz; intervals of ``faulty`` stamps [ns] are left out.
    """
    time_s, values = seconds(samples.stamp_ns, origin_ns), samples.values[:, :9]
    good = (np.isfinite(values) & ~wild(values)).all(axis=1)
    for start_ns, stop_ns in faulty:
        good &= (samples.stamp_ns < start_ns) | (samples.stamp_ns >= stop_ns)
    time_s, values = time_s[good], values[good]
    later = time_s > np.maximum.accumulate(np.concatenate([[-np.inf], time_s[:-1]]))[: len(time_s)]
    time_s, values = time_s[later], values[later]
    if len(time_s) < 2:
        return time_s, values
    k = round(1.0 / float(np.median(np.diff(time_s))) / RATE_HZ)
    if 2 <= k <= len(time_s):
        # A mean over the output period is a crude anti-alias filter, but only signals up to 5 Hz are used.
        starts = np.arange(0, len(time_s) - k + 1, k)
        time_s = np.asarray(np.add.reduceat(time_s[: starts[-1] + k], starts) / k, dtype=np.float64)
        values = np.asarray(np.add.reduceat(values[: starts[-1] + k], starts, axis=0) / k, dtype=np.float64)
    return time_s, values


def stretches(
    streams: Sequence[tuple[Array, Array]], clocks: ClockEstimate | None = None
) -> list[tuple[float, Array]]:
    """Return uniform stretches that all robots share: start [s] and samples at ``RATE_HZ``, shape (q, N, 9).

    ``streams`` come from ``clean_stream``; offsets and drifts of ``clocks`` are removed.
    """
    told = []
    for robot, (time_s, values) in enumerate(streams):
        if clocks is not None and np.isfinite(clocks.offset_s[robot]):
            since_s = time_s - clocks.middle_s - clocks.offset_s[robot]
            time_s = clocks.middle_s + since_s / (1.0 + clocks.drift[robot])
        told.append((time_s, values))
    shared = [(-np.inf, np.inf)]
    for time_s, _ in told:
        shared = _shared(shared, _whole(time_s))
    found = []
    for start, stop in shared:
        # The grid starts at a sample of robot 1, so that a log on one grid is unchanged.
        first_time = told[0][0]
        start = float(first_time[np.searchsorted(first_time, start - 1e-7)])
        count = int(np.floor((stop - start) * RATE_HZ + 1e-6)) + 1
        if count < SHORTEST_S * RATE_HZ:
            continue
        grid = start + np.arange(count) / RATE_HZ
        found.append((start, np.stack([_at(time_s, values, grid) for time_s, values in told], axis=1)))
    return found


def _whole(time_s: Array) -> list[tuple[float, float]]:
    """Return intervals without gaps."""
    if len(time_s) < 4:
        return []
    steps = np.diff(time_s)
    limit = max(MAX_GAP_S, _PERIODS * float(np.median(steps)))
    edges = np.flatnonzero(steps > limit)
    starts, stops = np.concatenate([[0], edges + 1]), np.concatenate([edges, [len(time_s) - 1]])
    return [(float(time_s[a]), float(time_s[b])) for a, b in zip(starts, stops, strict=True) if b - a >= 4]


def _shared(a: list[tuple[float, float]], b: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the intersection of two sorted lists of intervals."""
    both, i, j = [], 0, 0
    while i < len(a) and j < len(b):
        start, stop = max(a[i][0], b[j][0]), min(a[i][1], b[j][1])
        if stop > start:
            both.append((start, stop))
        if a[i][1] < b[j][1]:
            i += 1
        else:
            j += 1
    return both


def _at(time_s: Array, values: Array, grid: Array) -> Array:
    low = max(0, int(np.searchsorted(time_s, grid[0])) - 8)
    high = min(len(time_s), int(np.searchsorted(time_s, grid[-1])) + 8)
    spline = make_interp_spline(time_s[low:high], values[low:high], k=3)
    return np.asarray(spline(np.clip(grid, time_s[low], time_s[high - 1])), dtype=np.float64)


def segments(level: Level, parts: Sequence[tuple[float, Array]], design: OmnidDesign) -> Segments:
    """Classify windows of half a second of uniform stretches as rest or motion by the fastest robot."""
    # Order of magnitude of the wrist's speed; at joint level from a driven joint's rate.
    lever = 1.0 if level == "wrist" else design.proximal_length_m
    window, drop = round(WINDOW_S * RATE_HZ), round(TRIM_S * RATE_HZ)
    still_s = moving_s = 0.0
    rests: list[tuple[float, float]] = []
    for start, part in parts:
        rate = differentiate(low_pass(part[..., :6], RATE_HZ, CUTOFF_HZ), RATE_HZ)[drop:-drop]
        count = len(rate) // window
        square = (rate[: count * window] ** 2).reshape(count, window, -1, 2, 3).sum(axis=-1).mean(axis=1)
        speed, turning = np.sqrt(square).max(axis=1).T
        still = (lever * speed < STILL_SPEED_MPS) & (turning < STILL_RATE_RADPS)
        still_s += float(np.sum(still)) * WINDOW_S
        moving_s += float(np.sum(~still)) * WINDOW_S
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            if (last - first) * WINDOW_S >= DURATION_S:
                rests.append((start + TRIM_S + first * WINDOW_S, float(last - first) * WINDOW_S))
    return Segments(still_s, moving_s, tuple(rests))


def _clocks(parts: list[tuple[float, Array]]) -> ClockEstimate | None:
    """Estimate clocks from the longest stretch."""
    if not parts or parts[0][1].shape[1] < 2:
        return None
    start, part = max(parts, key=lambda entry: len(entry[1]))
    theta = [np.ascontiguousarray(part[:, robot, 3:6]) for robot in range(part.shape[1])]
    return estimate_clocks(theta, np.full(len(theta), start), RATE_HZ)


def _known(clocks: ClockEstimate, again: ClockEstimate | None) -> ClockEstimate:
    """Combine clock estimates: from the log as it is where known, else from the log with all mistakes undone."""
    if again is None:
        return clocks
    new = np.array([why is not None for why in clocks.why_not])
    numbers = {
        name: np.where(new, getattr(again, name), getattr(clocks, name))
        for name in ("offset_s", "drift", "mismatch", "repeats_s")
    }
    return replace(
        clocks,
        covariance=np.where(new[:, None, None], again.covariance, clocks.covariance),
        why_not=tuple(b if a else None for a, b in zip(clocks.why_not, again.why_not, strict=True)),
        **numbers,
    )


def differs(clocks: ClockEstimate, robot: int) -> bool:
    """Return whether the clock of a robot (from 0) differs significantly from that of robot 1."""
    offset, error = clocks.offset_s[robot], clocks.offset_se_s[robot]
    return bool(np.isfinite(offset) and abs(offset) > max(OFFSET_S, SIGMAS * error))
