"""Read one robot's joint log of any format by its map: uniform grid, SI units, joints in the model's order.

A log with even stamps keeps its own rate; any other log is interpolated and low-passed. Long gaps split a log into
parts. Uneven stamps are treated as in ``resample``: polynomials bridge short gaps, a quintic spline leads onto a finer
grid, and a known low-pass leads back to the log's rate. This averages the noise of close samples and avoids aliasing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import low_pass
from estimator.quantisation import rounding_step
from mocobot_logs.joints.asked_torque import with_asked_torques
from mocobot_logs.joints.joint_log import Drive, JointLog
from mocobot_logs.joints.joint_map import (
    COMMANDS,
    DUTIES,
    EFFORTS,
    LEAST_HZ,
    MOST_HZ,
    POSITIONS,
    QUANTITIES,
    VELOCITIES,
    Control,
    JointMap,
    label,
)
from mocobot_logs.log import NS, LogSource, Samples, Stamps, collect, repeated, rows_of
from mocobot_logs.open_log import open_log
from mocobot_logs.resample import LARGEST, MANY, MOST_MISSING, UNEVEN, Screen, beyond_s
from mocobot_logs.resample_filter import TOLERANCE_NS, Grid, fineness, fitted_rows, held_means, on_grid

EVEN_SHARE = 2e-3
"""Largest deviation of even stamps, as a share of a period. Derived: an arm turns by micrometres meanwhile."""
MAX_GAP_S = 0.05  # longest time without samples, beyond one period, that is bridged [s]
SHORTEST_S, LEAST_ROWS = 1.0, 32
"""Shortest part between gaps [s] and its least number of rows; shorter parts are left out."""
_BLOCK, _SLOW_SHARE, _SLOW = 64, 0.9, (1.1, 1.75)  # intervals; quantile; slower intervals over the median
_GAP = 1.75  # periods: jitter alone makes no longer intervals
_INSIDE = 0.1  # share of a period: an instant this close to a sample does not count as inside a gap


def open_joint_log(path: Path | str, log_map: JointMap, episode: int | None = None) -> LogSource:
    """Open a log of any format that ``open_log`` knows, by a map."""
    return open_log(path, log_map.of_source(), episode)


def read_joint_log(source: LogSource, log_map: JointMap) -> list[JointLog]:
    """Read a log and return its parts between long gaps; most logs have one part."""
    log = collect(source)
    return joint_logs_of(source.name, log.streams[0], log_map, log.notes)


def joint_logs_of(
    name: str, samples: Samples, log_map: JointMap, notes: Sequence[str] = ()
) -> list[JointLog]:
    """Return the parts between long gaps of a log in memory, whose channels are in the map's order.

    The map may set gains by the last part of the path ``name``; ``notes`` say how the log was read.
    """
    samples, log_map, without = _with_values(name, samples, log_map)
    held = np.array(log_map.held, dtype=bool)
    samples, told = _with_commands(samples, held)
    channels = tuple(label(*key) for key in log_map.channels)
    at = [k for k, (quantity, _) in enumerate(log_map.channels) if QUANTITIES[quantity].kind == "position"]
    positions, turned = unwrapped(samples.values[:, at], [channels[k] for k in at])
    if turned:
        values = samples.values.copy()
        values[:, at] = positions
        samples = replace(samples, values=values)
    control = log_map.control_of(Path(name).name)
    logs = [
        _joint_log(part, log_map, name, control, (*notes, *without, *turned))
        for part in _even_parts(name, channels, samples, log_map.rate_hz, (held, *told))
    ]
    if len(logs) == 1:
        return logs
    return [replace(log, name=f"{log.name} (part {number})") for number, log in enumerate(logs, 1)]


def _with_values(name: str, samples: Samples, log_map: JointMap) -> tuple[Samples, JointMap, list[str]]:
    """Leave out channels without a value in any row; return a sentence for each quantity. Positions stay."""
    empty = empty_channels(samples.values, log_map)
    if not empty or not len(samples.values):
        return samples, log_map, []
    kept = [k for k, key in enumerate(log_map.channels) if key not in empty]
    left = {key: channel for key, channel in log_map.channels.items() if key not in empty}
    names = {quantity for quantity, _ in left}
    joints = {quantity: ", ".join(of for q, of in empty if q == quantity) for quantity, _ in empty}
    told = [label(*each) for each in joints.items()]
    if not names & {*EFFORTS, *COMMANDS, *DUTIES}:
        lacking = "; ".join(told)
        raise InputError(
            f"{name}: has no value in any row for {lacking}; without a torque, a current, a command or a duty there is "
            "nothing to compare the model with"
        )
    control = log_map.control
    if control.command != "none" and not names & {*COMMANDS, *DUTIES}:
        control = replace(control, command="none")
    log_map = replace(log_map, channels=left, control=control)
    samples = replace(samples, values=samples.values[:, kept])
    return samples, log_map, [f"No row has a value of {each}; it is left out." for each in told]


def _with_commands(samples: Samples, held: NDArray[np.bool_]) -> tuple[Samples, tuple[Stamps, Array]]:
    """Let each command hold until the next one; drop rows before the first command, and rows of commands alone.

    Returns what is left, and the stamps and commands of all rows from the first command on.
    """
    gaps = np.isnan(samples.values[:, held])
    if not gaps.any():
        return samples, (samples.stamp_ns, samples.values[:, held])
    last = np.maximum.accumulate(np.where(gaps, -1, np.arange(len(gaps))[:, None]), axis=0)
    values = samples.values.copy()
    values[:, held] = np.take_along_axis(values[:, held], np.maximum(last, 0), axis=0)
    alone = np.isnan(values[:, ~held]).all(axis=1)
    known = (last >= 0).all(axis=1)
    rows = rows_of(replace(samples, values=values), np.flatnonzero(known & ~alone))
    return rows, (samples.stamp_ns[known], values[known][:, held])


def empty_channels(values: Array, log_map: JointMap) -> list[tuple[str, str]]:
    """Return the channels, other than positions, that have no value in any row of ``values``, shape (q, C)."""
    given = _given(values)
    return [
        key for key, some in zip(log_map.channels, given, strict=True) if not some and key[0] not in POSITIONS
    ]


@dataclass(frozen=True, eq=False)
class _Even:
    """A part of a log on a uniform grid."""

    start_s: float  # time of the first sample after the log's first stamp [s]
    rate_hz: float  # rate of the grid [Hz]
    values: Array  # channels [SI], shape (Q, C)
    usable: NDArray[np.bool_]  # False where a gap was bridged, shape (Q,)
    native_hz: float  # sample rate of the log [Hz]
    resampled: bool  # whether the samples were interpolated or low-passed
    raw: Array  # samples before resampling, shape (q, C)
    notes: tuple[str, ...]  # sentences that say how the samples were processed


def _even_parts(
    name: str,
    channels: tuple[str, ...],
    samples: Samples,
    rate_hz: float | None,
    told: tuple[NDArray[np.bool_], Stamps, Array],
) -> list[_Even]:
    """Split a log at gaps too long to be bridged and resample each part to ``rate_hz`` [Hz] or the log's own rate.

    Channels that are held (``told``: which, shape (C,), all their stamps and values) are not interpolated: each instant
    has the mean of what held for one period of the log from there on, also where a row lacks other values.
    """
    _check_values(name, channels, samples.values)
    screen = Screen(name, channels)
    time_ns, values = screen.keep(samples)
    told = told[0], told[1] - (screen.first_ns or 0), told[2]
    if len(time_ns) < LEAST_ROWS:
        again = f" ({repeated(screen.repeats)})" if screen.repeats else ""
        raise InputError(f"{name}: has {len(time_ns)} samples{again}; at least {LEAST_ROWS} are needed")
    period_ns = _period_ns(np.diff(time_ns))
    native_hz = 1.0 / (period_ns * NS)
    if not LEAST_HZ <= native_hz <= MOST_HZ:
        raise InputError(
            f"{name}: samples come {period_ns * NS:.6g} s apart, at {native_hz:.6g} Hz; {LEAST_HZ:g} to {MOST_HZ:g} Hz "
            "are allowed (is the unit of time right?)"
        )
    if rate_hz is not None and rate_hz > 1.01 * native_hz:
        raise InputError(
            f"{name}: the map's rate_hz is {rate_hz:g}, but the log has {native_hz:.6g} samples a second; it must be "
            "at most that"
        )
    notes = _notes(screen)
    holes = np.flatnonzero(beyond_s(np.diff(time_ns), period_ns) > MAX_GAP_S)
    edges = np.concatenate([[0], holes + 1, [len(time_ns)]])
    parts, lost_s = [], 0.0
    for first, end in pairwise(edges):
        length_s = float(time_ns[end - 1] - time_ns[first]) * NS
        if length_s < SHORTEST_S or end - first < LEAST_ROWS:
            lost_s += length_s
            continue
        parts.append(_even(time_ns[first:end], values[first:end], period_ns, rate_hz, told))
    if not parts:
        raise InputError(
            f"{name}: no part of it has samples for {SHORTEST_S:g} s without a gap of more than {MAX_GAP_S:g} s"
        )
    if len(holes):
        longest = float(np.diff(time_ns)[holes].max()) * NS
        notes.append(
            f"{len(holes)} gap{'s' * (len(holes) > 1)} of up to {longest:.3g} s cut the log into {len(parts)} part"
            f"{'s' * (len(parts) > 1)}{f'; {lost_s:.3g} s are in none of them' if lost_s else ''}."
        )
    return [replace(part, notes=(*notes, *part.notes)) for part in parts]


def _even(
    time_ns: Stamps,
    values: Array,
    period_ns: float,
    rate_hz: float | None,
    told: tuple[NDArray[np.bool_], Stamps, Array],
) -> _Even:
    """Resample one part without long gaps."""
    first_ns = int(time_ns[0])
    stamped_ns = time_ns = time_ns - first_ns
    held, told_ns, commands = told
    found = _own_grid(time_ns, period_ns)
    native_hz = (len(time_ns) - 1) / (float(time_ns[-1]) * NS)
    grid, k, wanted, notes = None, 1, rate_hz, []
    if found is not None:
        period_ns, index, rounded = found
        even_hz = _plain(1.0 / (period_ns * NS))
        time_ns = np.rint(index * period_ns).astype(np.int64)
        if rounded:
            notes.append(
                f"Stamps are rounded to {rounded * NS:.3g} s; samples are taken as even, {period_ns * NS:.6g} s apart."
            )
        ratio = even_hz / (even_hz if rate_hz is None else rate_hz)
        native_hz = (len(time_ns) - 1) / (float(time_ns[-1]) * NS)
        if abs(ratio - round(ratio)) < 1e-4:
            k, native_hz = round(ratio), even_hz
            grid, wanted = Grid(period_ns, period_ns, fits=True), even_hz / k
    if wanted is None:
        wanted = float(np.floor(1.0 / (period_ns * NS) + 0.01))
    if grid is None:
        interval = np.diff(time_ns)
        jitter = float(np.std(interval - np.maximum(np.rint(interval / period_ns), 1.0) * period_ns))
        fitted = found is None and native_hz >= MANY * wanted and jitter > UNEVEN * period_ns
        if fitted:
            period_ns = float(np.mean(interval))
        k = fineness(1.0 / (period_ns * NS), wanted, fitted=fitted)
        rows = fitted_rows(native_hz, wanted) if fitted else 0
        grid = Grid(1.0 / (k * wanted) / NS, period_ns, fitted_rows=rows)
        if found is None:
            notes.append(
                f"Stamps are uneven ({interval.min() * NS:.3g} to {interval.max() * NS:.3g} s apart); samples were "
                f"interpolated at {wanted:g} Hz, and nothing above {0.2 * wanted:.3g} Hz is relied on."
            )
    out, lead = on_grid(time_ns, values, grid, k)
    at_ns = (lead + np.arange(len(out))) / wanted / NS
    # Stamps that count as even move, and those of commands between them move along.
    told_ns = (
        told_ns
        - first_ns
        + np.rint(np.interp(told_ns - first_ns, stamped_ns, time_ns - stamped_ns)).astype(int)
    )
    out[:, held] = held_means(told_ns, commands, at_ns, at_ns + period_ns)
    usable = _between_samples(at_ns, time_ns, grid.period_ns)
    if not usable.all():
        notes.append(f"{np.sum(~usable)} of {len(out)} samples are bridged gaps and are left out.")
    start_s = (first_ns + float(at_ns[0])) * NS
    return _Even(start_s, wanted, out, usable, native_hz, not grid.fits or k > 1, values, tuple(notes))


def _between_samples(at_ns: Array, time_ns: Stamps, period_ns: float) -> NDArray[np.bool_]:
    """Return which instants lie outside all gaps."""
    after = np.clip(np.searchsorted(time_ns, at_ns), 1, len(time_ns) - 1)
    left, right = time_ns[after - 1], time_ns[after]
    margin = _INSIDE * period_ns
    inside = (at_ns - left > margin) & (right - at_ns > margin)
    return ~(inside & (right - left > _GAP * period_ns))


def _own_grid(time_ns: Stamps, period_ns: float) -> tuple[float, NDArray[np.int64], float] | None:
    """Fit a grid to even stamps; None if they are uneven.

    Stamps rounded to milliseconds or clock ticks count as even if each is off by no more than the rounding.

    Returns:
        Spacing [ns], index of each sample, and rounding step of the stamps [ns], 0 if they are not rounded.
    """
    interval = np.diff(time_ns)
    step_ns = float(np.gcd.reduce(interval))
    index = np.concatenate([[0], np.cumsum(np.rint(interval / period_ns))]).astype(np.int64)
    if np.any(np.diff(index) < 1):
        return None
    spacing_ns, offset_ns = period_ns, 0.0
    for _ in range(3):  # a small error of the spacing shifts the indices of a long log
        spacing_ns, offset_ns = np.polyfit(index.astype(float), time_ns.astype(float), 1)
        again = np.rint((time_ns - offset_ns) / spacing_ns).astype(np.int64)
        again -= again[0]
        if np.array_equal(again, index):
            break
        index = again
    if np.any(np.diff(index) < 1):
        return None
    off_ns = np.abs(time_ns - offset_ns - index * spacing_ns).max()
    coarse = step_ns if step_ns > 2.0 * TOLERANCE_NS and step_ns < 1.01 * period_ns else 0.0
    if off_ns <= max(TOLERANCE_NS + 0.5, EVEN_SHARE * period_ns):
        return float(spacing_ns), index, 0.0
    if coarse and off_ns <= 0.75 * coarse and coarse < 0.75 * period_ns:
        return float(spacing_ns), index, coarse
    return None


def _period_ns(interval: Stamps) -> float:
    """Return the usual interval, or the slower one if the log's rate changes by less than a factor of two.

    Means over many intervals show such a change; jitter and single gaps do not affect them.
    """
    median = float(np.median(interval))
    blocks = interval[: len(interval) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    if not len(blocks):
        return median
    slower = float(np.quantile(blocks, _SLOW_SHARE) / np.median(blocks))
    return median * slower if _SLOW[0] < slower < _SLOW[1] else median


def _plain(rate_hz: float) -> float:
    """Round a rate to a whole number if the difference may come from rounded stamps."""
    whole = round(rate_hz)
    return float(whole) if abs(rate_hz - whole) < 1e-5 * rate_hz else rate_hz


def _check_values(name: str, channels: tuple[str, ...], values: Array) -> None:
    if not len(values):
        raise InputError(f"{name}: has no samples")
    infinite = np.argwhere(np.abs(values) >= LARGEST)
    if len(infinite):
        row, k = infinite[0]
        raise InputError(
            f"{name}: {channels[k]} is {values[row, k]} in row {row}; every value must be finite (a cell may be empty)"
        )
    blank = np.isnan(values).mean(axis=0)
    k = int(np.argmax(blank))
    if blank[k] > MOST_MISSING:
        lost = f"{100 * blank[k]:.3g} % of the rows" if blank[k] < 1 else "any row"
        raise InputError(
            f"{name}: {channels[k]} has no value in {lost}; at most {100 * MOST_MISSING:g} % may lack one (a joint "
            "without such a column says so in the map: CHANNEL = false)"
        )


def _notes(screen: Screen) -> list[str]:
    notes = []
    if screen.duplicates:
        notes.append(f"{screen.duplicates} rows repeat the row before, stamp included, and were dropped.")
    if screen.repeats:
        notes.append(f"{repeated(screen.repeats)}.")
    if screen.blank:
        worst = max(screen.blank_channels, key=lambda channel: screen.blank_channels[channel])
        notes.append(f"{screen.blank} rows lack a value ({worst} first) and count as missing.")
    return notes


TURN = 2.0 * np.pi
LEAST_JUMP = 0.75  # share of a turn that no joint moves between two samples: at 20 Hz it would be 94 rad/s
ONE_TURN = 1.01  # largest range, in turns, of an encoder that wraps around


def unwrapped(values: Array, names: Sequence[str]) -> tuple[Array, list[str]]:
    """Remove jumps by a full turn from positions [rad], shape (q, C), NaN where a row lacks one.

    Returns the positions, and a sentence for each of the C named channels that changed.
    """
    out, notes = values, []
    for c, name in enumerate(names):
        known = np.flatnonzero(np.isfinite(values[:, c]))
        x = values[known, c]
        if not len(x) or np.ptp(x) > ONE_TURN * TURN:
            continue
        jumps = int(np.sum(np.abs(np.diff(x)) > LEAST_JUMP * TURN))
        if jumps:
            out = out.copy() if out is values else out
            out[known, c] = np.unwrap(x)
            times = "once" if jumps == 1 else f"{jumps} times"
            notes.append(
                f"{name} is told within one turn; {times} it jumps by a full turn, which is taken out."
            )
    return out, notes


SUPPLY_HZ = 1.0
"""Cut-off frequency of a supply's reading [Hz]. Chosen: batteries and cables sag within seconds, and faster changes are
ringing of the switched bus, which a reading samples at random (Measured, XL330: 5.7 to 9.2 V, mean 7.0 to 7.4 V).
"""


def mean_supply(reading: Array, rate_hz: float) -> Array:
    """Low-pass a supply's reading of at least 16 uniform samples [V], shape (Q,).

    A drive's switching makes the bus ring, and readings fall at random phases of its period. An XL330 at a steady duty
    of 0.7 reads 6.2, 7.3 and 8.2 V in turn; their mean is near its idle supply. The winding sees this mean.
    """
    # The filter passes through the first and last value of its input: padding with means removes their noise.
    end = round(rate_hz / SUPPLY_HZ)
    wide = np.concatenate([np.full(end, reading[:end].mean()), reading, np.full(end, reading[-end:].mean())])
    return low_pass(wide, rate_hz, SUPPLY_HZ)[end : end + len(reading)]


_STEP_ROWS = 1024  # rows per block in which the step of a reading is searched
_STEP_BLOCKS = 8


@dataclass(frozen=True, eq=False)
class _Columns:
    """Channels of one part of a log by quantity and joint; values have shape (Q, C), in the map's order."""

    log_map: JointMap
    values: Array

    def of(self, quantity: str) -> Array:
        """Return a quantity of all joints, NaN where a joint has none, shape (Q, J)."""
        keys, joints = list(self.log_map.channels), self.log_map.joints
        found = np.full((len(self.values), len(joints)), np.nan)
        for k, (name, joint) in enumerate(keys):
            if name == quantity:
                found[:, joints.index(joint)] = self.values[:, k]
        return found

    def shared(self, quantity: str) -> Array | None:
        """Return a quantity of the whole robot, shape (Q,), or None."""
        keys = list(self.log_map.channels)
        return self.values[:, keys.index((quantity, ""))] if (quantity, "") in keys else None

    def has(self, *quantities: str) -> bool:
        """Return whether any joint has one of the quantities."""
        return any(name in quantities for name, _ in self.log_map.channels)


def _joint_log(part: _Even, log_map: JointMap, name: str, control: Control, notes: Sequence[str]) -> JointLog:
    """Convert one part of a log to joint quantities."""
    columns = _Columns(log_map, part.values)
    turns, zero = log_map.turns, log_map.zero
    where = f"map {log_map.name}"
    joint_side = columns.of("q")
    motor_side = columns.of("motor_position")
    # If a joint is read on both sides of its gear, q is the link's reading, and the motor's reading is kept
    # separately.
    both = _given(joint_side) & _given(motor_side)
    q = _joints_from_motors(joint_side, np.where(both, np.nan, motor_side), turns, where, "motor_position")
    motor = None
    if both.any():
        seen = np.where(_given(motor_side), motor_side, (q @ turns.T))
        motor = np.where(both, seen @ np.linalg.inv(turns).T + zero, np.nan)
    dq = None
    if columns.has(*VELOCITIES):
        dq = _joints_from_motors(
            columns.of("dq"), columns.of("motor_velocity"), turns, where, "motor_velocity"
        )
    supply_V = _supply(columns, control, name, part.rate_hz)
    drive = Drive(
        gear=np.diag(turns).copy(),
        coupling=np.asarray(np.linalg.inv(turns), dtype=np.float64),
        torque_constant=_constants(columns, log_map, where),
        link_side=_given(columns.of("link_torque")),
        command=control.command,
        position_gain=np.where(np.isinf(control.position_gain), np.nan, control.position_gain),
        velocity_gain=np.where(np.isinf(control.velocity_gain), np.nan, control.velocity_gain),
        gain_of=control.gain_of,
        limit=control.limit,
        supply_V=supply_V,
        duty=_duty(columns, supply_V),
        gain_within=_gain_within(control),
        delay_s=control.delay_s,
        held=control.held,
        feedforward=columns.of("feedforward") if columns.has("feedforward") else None,
        command_velocity=columns.of("command_velocity") if columns.has("command_velocity") else None,
    )
    flags = columns.shared("enabled")
    log = JointLog(
        name=name,
        time=np.arange(len(part.values)) / part.rate_hz,
        rate_hz=part.rate_hz,
        q=q + zero,
        torque=_torque(columns, drive, turns, where),
        dq=dq,
        command=_command(columns, control, turns, zero, where),
        joints=log_map.joints,
        drive=drive,
        position_step=_position_step(part, log_map, turns),
        usable=part.usable,
        native_hz=part.native_hz,
        resampled=part.resampled,
        start_s=part.start_s,
        enabled=None if flags is None else flags > 0.5,
        motor=motor,
        notes=(*notes, *part.notes),
    )
    return with_asked_torques(log)


def _gain_within(control: Control) -> Array:
    """Return the factors within which position and velocity gains are known, shape (J, 2)."""
    gains = np.column_stack([control.position_gain, control.velocity_gain])
    return np.where(np.isinf(gains), np.inf, control.gain_known_within[:, None])


def _given(values: Array) -> NDArray[np.bool_]:
    """Return which joints have a column, shape (J,)."""
    return np.asarray(~np.isnan(values).all(axis=0))


def _joints_from_motors(joint: Array, motor: Array, turns: Array, where: str, channel: str) -> Array:
    """Return positions or velocities of all joints, shape (Q, J), from joint readings where given, else from motor
    readings."""
    at_joint, at_motor = _given(joint), _given(motor)
    out = joint.copy()
    solved = at_motor & ~at_joint
    if not solved.any():
        return out
    lacking = ~at_joint & ~at_motor
    needed = (turns[np.ix_(solved, lacking)] != 0).any(axis=0)
    if needed.any():
        raise InputError(
            f"{where}: drive: coupling: a drive is coupled with a joint that has no {channel}; log it or leave the "
            "coupling out"
        )
    rest = motor[:, solved] - joint[:, at_joint] @ turns[np.ix_(solved, at_joint)].T
    out[:, solved] = np.linalg.solve(turns[np.ix_(solved, solved)], rest.T).T
    return out


def _at_joints(motor: Array, turns: Array, where: str, channel: str) -> Array:
    """Return joint torques from motor torques, NaN where a joint has none, shape (Q, J)."""
    given = _given(motor)
    out = np.full(motor.shape, np.nan)
    for j in np.flatnonzero(given):
        motors = np.flatnonzero(turns[:, j])
        if not given[motors].all():
            raise InputError(
                f"{where}: drive: coupling: the drive of joint {j + 1} is coupled with one that has no {channel}; log "
                "it or leave the coupling out"
            )
        out[:, j] = motor[:, motors] @ turns[motors, j]
    return out


def _constants(columns: _Columns, log_map: JointMap, where: str) -> Array:
    """Return the torque constants of joints with currents, 1 for the others."""
    constants = np.where(_given(columns.of("current")), log_map.torque_constant, 1.0)
    coupled = log_map.turns - np.diag(np.diag(log_map.turns)) != 0
    if (np.isnan(constants) & (coupled.any(axis=0) | coupled.any(axis=1))).any():
        raise InputError(
            f"{where}: drive: torque_constant is 'free' for coupled drives; it must be known there, for their torques "
            "add up in one joint"
        )
    return constants


def _torque(columns: _Columns, drive: Drive, turns: Array, where: str) -> Array | None:
    if not columns.has(*EFFORTS):
        return None
    constants = np.where(np.isnan(drive.torque_constant), 1.0, drive.torque_constant)
    current = columns.of("current") * constants
    motor = columns.of("motor_torque")
    motor = np.where(_given(motor), motor, current)
    torque = columns.of("torque")
    for other in (columns.of("link_torque"), _at_joints(motor, turns, where, "motor_torque or current")):
        torque = np.where(_given(torque), torque, other)
    return torque


def _command(columns: _Columns, control: Control, turns: Array, zero: Array, where: str) -> Array | None:
    if not columns.has(*COMMANDS):
        return None
    joint, motor = columns.of("command"), columns.of("motor_command")
    if control.command == "torque":
        return np.where(_given(joint), joint, _at_joints(motor, turns, where, "motor_command"))
    at_joints = _joints_from_motors(joint, motor, turns, where, "motor_command")
    return at_joints + zero if control.command == "position" else at_joints


def _supply(columns: _Columns, control: Control, name: str, rate_hz: float) -> Array | None:
    supply_V = columns.shared("supply")
    if supply_V is None:
        return None if control.supply_V is None else np.full(len(columns.values), control.supply_V)
    if (supply_V <= 0).any():
        row = int(np.argmax(supply_V <= 0))
        raise InputError(f"{name}: supply is {supply_V[row]:.4g} V in sample {row}; it must be positive")
    return mean_supply(supply_V, rate_hz)


def _duty(columns: _Columns, supply_V: Array | None) -> Array | None:
    if not columns.has(*DUTIES):
        return None
    duty, voltage = columns.of("duty"), columns.of("motor_voltage")
    if supply_V is not None:
        duty = np.where(_given(duty), duty, voltage / supply_V[:, None])
    return duty


def _position_step(part: _Even, log_map: JointMap, turns: Array) -> Array:
    """Return the resolution of the positions [rad or m], shape (J,); rounding noise adds up through coupled drives."""
    joints = log_map.joints
    at_joint, at_motor = np.zeros(len(joints)), np.zeros(len(joints))
    for k, ((name, joint), channel) in enumerate(log_map.channels.items()):
        if name in POSITIONS:
            step = abs(channel.scale) if channel.counted else _step_of(part.raw[:, k])
            (at_joint if name == "q" else at_motor)[joints.index(joint)] = step
    from_motors = np.sqrt(np.linalg.inv(turns) ** 2 @ at_motor**2)
    own = np.array([("q", joint) in log_map.channels for joint in joints])
    return np.where(own, at_joint, from_motors)


def _step_of(values: Array) -> float:
    """Return the rounding step of a reading, 0 if none is found."""
    starts = np.linspace(0, max(len(values) - _STEP_ROWS, 0), _STEP_BLOCKS).astype(int)
    found = [rounding_step(values[first : first + _STEP_ROWS]) for first in dict.fromkeys(starts.tolist())]
    told = [step for step in found if step > 0]
    return float(np.median(told)) if told else 0.0
