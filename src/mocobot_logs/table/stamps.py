"""Time of a table in whole nanoseconds: exact for whole numbers and dates, rounded for floats and decimal text."""

from bisect import bisect_left

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import Stamps

LARGEST_NS = (1 << 63) - 1
_DIGITS = {10**exponent: exponent for exponent in range(10)}
_BELOW_NS = 6
"""Decimals below the nanosecond that are looked at, to round: programs write 32439.999999999996 ms for 32.44 s."""

Given = NDArray[np.bool_]


def from_numbers(values: NDArray, unit_ns: int | None, where: str, row: int = 0) -> tuple[Stamps, Given]:
    """Stamps from numbers.

    Args:
        values: times in any unit, whole numbers or floats, NaN where there is none, shape (q,).
        unit_ns: nanoseconds in one unit; None where the map's unit is "iso".
        where: file and column, for messages.
        row: row of the first one, for messages.

    Returns:
        Stamps [ns], 0 where there is none, and where there is one; each of shape (q,).

    Raises:
        InputError: a time is infinite or beyond 292 years, or there is no unit.
    """
    unit_ns = _unit(unit_ns, where)
    if values.dtype.kind in "iu":
        limit = LARGEST_NS // unit_ns
        beyond = (values > limit) | (values < -limit)
        _refuse(values, beyond, where, row)
        return values.astype(np.int64) * unit_ns, np.ones(len(values), bool)
    given = ~np.isnan(values)
    with np.errstate(over="ignore"):
        scaled = np.where(given, values, 0.0).astype(np.float64) * unit_ns
    # One below 2**63: the next float down from it is whole and fits.
    _refuse(values, np.abs(scaled) >= float(LARGEST_NS), where, row)
    return np.rint(scaled).astype(np.int64), given


def from_text(values: pa.Array, unit_ns: int | None, where: str, row: int = 0) -> tuple[Stamps, Given]:
    """Stamps from decimal text, to the nearest nanosecond: a float of the Unix time resolves 0.24 us only.

    Args:
        values: decimal numbers, null where there is none, shape (q,).
        unit_ns: nanoseconds in one unit, a power of ten; None where the map's unit is "iso".
        where: file and column, for messages.
        row: row of the first one, for messages.

    Returns:
        As ``from_numbers``.

    Raises:
        InputError: a time is not a number, or is beyond 292 years, or there is no unit.
    """
    digits = _DIGITS[_unit(unit_ns, where)]
    exact = pa.decimal128(38, digits)
    try:
        cut = pc.cast(values, exact, safe=False)
    except pa.ArrowInvalid:
        # The first count of texts that do not cast ends with the one that is no number.
        bad = bisect_left(range(1, len(values)), True, key=lambda count: not _casts(values[:count], exact))
        text = values[bad].as_py()
        or_date = "" if row + bad else " or a date of ISO 8601, such as 2026-03-01T12:00:00.5Z"
        raise InputError(
            f"{where} is {text!r:.60} in row {row + bad}; a time must be a number{or_date}"
        ) from None
    _in_ns(cut, values, where, row)
    finer = pc.cast(values, pa.decimal256(76, digits + _BELOW_NS), safe=False)
    rounded = pc.cast(pc.call_function("round", [finer], pc.RoundOptions(digits)), exact)
    ns = _in_ns(rounded, values, where, row)
    given = ns.is_valid().to_numpy(zero_copy_only=False)
    return pc.fill_null(ns, 0).cast(pa.int64()).to_numpy(zero_copy_only=False), given


def _in_ns(decimals: pa.Array, values: pa.Array, where: str, row: int) -> pa.Array:
    """Decimals with nanoseconds as their last digits as these; refused beyond 292 years."""
    ns = decimals.view(pa.decimal128(38, 0))  # the digits without the point are the nanoseconds
    size = pc.call_function("abs", [ns])
    beyond = pc.fill_null(pc.call_function("greater", [size, pa.scalar(LARGEST_NS)]), False)
    _refuse(values, beyond.to_numpy(zero_copy_only=False), where, row)
    return ns


def _unit(unit_ns: int | None, where: str) -> int:
    if unit_ns is None:
        raise InputError(f"{where} holds numbers, but the map's unit of time is 'iso', which is for dates")
    return unit_ns


def _casts(values: pa.Array, kind: pa.DataType) -> bool:
    try:
        pc.cast(values, kind, safe=False)
    except pa.ArrowInvalid:
        return False
    return True


def _refuse(values: NDArray | pa.Array, beyond: Given, where: str, row: int) -> None:
    if beyond.any():
        first = int(np.flatnonzero(beyond)[0])
        raise InputError(_range(where, row + first, values[first]))


def _range(where: str, row: int, value: object) -> str:
    return f"{where} is {value!s:.40} in row {row}; a time must be finite and within 292 years (is its unit right?)"
