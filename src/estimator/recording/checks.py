"""Check that a recording is plausible before any computation; one sentence per fault."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from estimator.arm.delta import stretches
from estimator.arrays import Array
from estimator.errors import InputError, RepeatedRowsError
from estimator.filtering import MIN_SAMPLES, trim_slice
from estimator.quantisation import Repeats
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording

SPACING_TOLERANCE = 0.5  # largest jitter of a time stamp, in sample periods
TORQUE_FACTOR = 2.0  # times torque_limit_Nm: larger torques are a spike or have another unit
RATE_TOLERANCE = 1e-3  # of rate_hz: its error enters accelerations, and so inertia, squared

MOST_REPEATED = 8
"""Number of rows that may repeat the one before without affecting an estimate."""
_MOST = 0.9  # share of the rows: a filter spreads the few rows at a jump by a full turn


def check_recording(recording: Recording) -> None:
    """Check number of rows, finiteness, time axis, repeats, joint ranges, torques and legs of a recording.

    Raises:
        InputError: names the recording, the column, the row (counted from 0), the value and what is allowed.
    """
    rows = len(recording.time)
    if rows < MIN_SAMPLES:
        raise InputError(f"{recording.name}: {rows} rows are too few; at least {MIN_SAMPLES} are needed")
    check_finite(recording.name, recording.columns())
    _check_time(recording)
    _check_repeats(recording)
    design = recording.metadata.design
    _check_range(recording, ("phi1", "phi2", "phi3"), design.phi_min_rad, design.phi_max_rad)
    limit = design.gimbal_limit_rad
    _check_range(recording, ("theta_z", "theta_y", "theta_x"), -limit, limit)
    _check_torques(recording)
    _check_legs(recording)


def check_carries(recording: Recording, done: str) -> None:
    """Check that the robots carried something; ``done`` is the operation in messages, such as ``"estimated"``.

    Raises:
        InputError: it is a free trial.
    """
    if recording.metadata.trial == FREE:
        raise InputError(
            f"{recording.name}: trial is {FREE!r}: the robots hold nothing, so nothing can be {done}; "
            "mocobot calibrate --free takes it"
        )


def check_duration(recording: Recording, trim_s: float) -> None:
    """Check that samples remain after dropping ``trim_s`` seconds at each end.

    Raises:
        InputError: no sample would remain, or trim_s is not a non-negative number.
    """
    try:
        trim_slice(len(recording.time), recording.metadata.rate_hz, trim_s)
    except InputError as error:
        raise InputError(f"{recording.name}: {error}") from error


def check_finite(name: str, columns: Mapping[str, Array]) -> None:
    """Check that columns contain finite numbers only.

    Raises:
        InputError: names the recording, the column and the row (counted from 0).
    """
    for column, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"{name}: column {column!r} is {values[bad[0]]} in {len(bad)} of {len(values)} rows, "
                f"first in row {bad[0]}; every value must be a finite number"
            )


def _check_time(recording: Recording) -> None:
    time, rate_hz, name = recording.time, recording.metadata.rate_hz, recording.name
    spacing = np.diff(time)
    backward = np.flatnonzero(spacing <= 0)
    if len(backward):
        row = int(backward[0]) + 1
        what = "repeats" if spacing[row - 1] == 0 else "goes back"
        raise InputError(
            f"{name}: time {what} in row {row} (from {time[row - 1]:.9g} s to {time[row]:.9g} s); "
            "it must increase"
        )
    # The median ignores gaps, so a gap is not reported as a wrong rate; the mean ignores jitter.
    if abs(np.median(spacing) * rate_hz - 1.0) > SPACING_TOLERANCE / 2:
        raise InputError(
            f"{name}: samples are {np.median(spacing):.6g} s apart, but rate_hz is {rate_hz:g}, "
            f"which makes {1 / rate_hz:.6g} s"
        )
    uneven = np.flatnonzero(np.abs(spacing * rate_hz - 1.0) > SPACING_TOLERANCE)
    if len(uneven):
        row = int(uneven[0]) + 1
        low, high = (1 - SPACING_TOLERANCE) / rate_hz, (1 + SPACING_TOLERANCE) / rate_hz
        what = "a gap" if spacing[row - 1] > high else "a crowding"
        raise InputError(
            f"{name}: {what} in time of {spacing[row - 1]:.6g} s before row {row} "
            f"(from {time[row - 1]:.9g} s to {time[row]:.9g} s); "
            f"samples must be {low:.4g} to {high:.4g} s apart at {rate_hz:g} Hz"
        )
    intervals, duration = len(spacing), time[-1] - time[0]
    # In samples; the first and the last stamp may also jitter.
    drift = duration * rate_hz - intervals
    if abs(drift) > RATE_TOLERANCE * intervals + 2 * SPACING_TOLERANCE:
        raise InputError(
            f"{name}: samples come at {intervals / duration:.6g} Hz on average, but rate_hz is {rate_hz:g}; "
            f"they must agree within {100 * RATE_TOLERANCE:g} %"
        )


def _check_repeats(recording: Recording) -> None:
    """Refuse rows that repeat the one before: they are one reading, but would count as many."""
    for robot in range(recording.metadata.robots):
        read = (recording.phi, recording.theta, recording.tau)
        repeats = Repeats(range(6, 9)).of(np.concatenate([field[:, robot] for field in read], axis=1))
        if repeats.sum() > MOST_REPEATED:
            raise RepeatedRowsError(
                f"{recording.name}: {repeats.sum()} of {len(repeats)} rows of omnid{robot + 1} repeat the one before, "
                f"first row {np.argmax(repeats)}; a reading counts once (mocobot convert counts the others as missing)"
            )


def _check_range(recording: Recording, suffixes: tuple[str, ...], low: float, high: float) -> None:
    """Check the limits of one kind of joint; the bound itself is allowed."""
    columns = {name: x for name, x in recording.columns().items() if name.rpartition(".")[2] in suffixes}
    least, largest = min(x.min() for x in columns.values()), max(x.max() for x in columns.values())
    # Degrees are far outside the range as radians, and all inside after conversion.
    in_degrees = (
        max(-least, largest) > 2.0 * max(-low, high)
        and np.deg2rad(least) >= low
        and np.deg2rad(largest) <= high
    )
    for name, values in columns.items():
        bad = np.flatnonzero((values < low) | (values > high))
        if len(bad):
            worst = values[bad[np.argmax(np.abs(values[bad]))]]
            raise InputError(
                f"{recording.name}: {_called(recording, name)} reaches {worst:.6g} rad (outside in {len(bad)} of "
                f"{len(values)} rows, first in row {bad[0]}); its range is {low:.6g} to {high:.6g} rad"
                + _looks_like(values, low, high, in_degrees=in_degrees)
            )


def _looks_like(values: Array, low: float, high: float, *, in_degrees: bool) -> str:
    """Guess the cause of angles [rad] beyond their range, for the end of a sentence."""
    middle, half = (low + high) / 2, (high - low) / 2
    turns = np.rint((values - middle) / (2 * np.pi))
    inside = np.abs(values - 2 * np.pi * turns - middle) <= half
    if np.mean(inside) > _MOST and len(np.unique(turns[inside])) > 1:
        return " - the values jump by a full turn, which has to be taken out before (numpy.unwrap)"
    return " - the values look like degrees" if in_degrees else ""


def _called(recording: Recording, name: str) -> str:
    """Name a column according to the file: at wrist level it has neither driven angles nor torques."""
    robot, _, channel = name.partition(".")
    if recording.metadata.level == "joint" or channel.startswith("theta"):
        return f"column {name!r}"
    of = "h_x, h_y, h_z" if channel.startswith("phi") else "force_x, force_y, force_z and the wrist position"
    return f"{channel} of {robot}, which follows from its {of},"


def _check_torques(recording: Recording) -> None:
    limit = recording.metadata.design.torque_limit_Nm
    for name, values in recording.columns().items():
        bad = np.flatnonzero(np.abs(values) > TORQUE_FACTOR * limit) if ".tau" in name else []
        if len(bad):
            worst = values[bad[np.argmax(np.abs(values[bad]))]]
            raise InputError(
                f"{recording.name}: {_called(recording, name)} reaches {worst:.6g} N m (in {len(bad)} of {len(values)} "
                f"rows, first in row {bad[0]}), more than {TORQUE_FACTOR:g} times the design's "
                f"torque_limit_Nm of {limit:g}"
            )


def _check_legs(recording: Recording) -> None:
    robots = range(recording.metadata.robots)

    def fail(row: int, robot: int, what: str) -> None:
        angles = ", ".join(f"{value:.6g}" for value in recording.phi[row, robot])
        raise InputError(
            f"{recording.name}: omnid{robot + 1} has phi = ({angles}) rad in row {row}, where {what}; "
            "are zeros, signs and order of the joints right?"
        )

    # One robot at a time: the geometry takes ten times the memory of the angles.
    arms = [(recording.joints(robot)[0], recording.arm(robot)) for robot in robots]
    found = [stretches(phi, arm) for phi, arm in arms]
    if (first := _first([np.flatnonzero(~meet) for meet, _ in found])) is not None:
        fail(*first, "the three rods cannot meet")
    folded = [leverage <= 0 for _, leverage in found]
    if (first := _first([np.flatnonzero(legs.any(axis=1)) for legs in folded])) is not None:
        leg = int(np.argmax(folded[first[1]][first[0]]))
        fail(*first, f"leg {leg + 1} is past its stretched position")


def _first(rows: list[NDArray[np.intp]]) -> tuple[int, int] | None:
    """Return the first row of any robot, and that robot, from the rows of each."""
    found = [(int(of_robot[0]), robot) for robot, of_robot in enumerate(rows) if len(of_robot)]
    return min(found) if found else None
