"""Dates and times of ISO 8601 as stamps, exact to the nanosecond."""

import re

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from estimator.errors import InputError
from mocobot_logs.log import Stamps
from mocobot_logs.table.stamps import LARGEST_NS, Given, from_text

_DATE = r"[0-9]{4}-[0-9]{2}-[0-9]{2}|[0-9]{8}"
_TIME = r"[0-9]{2}(?::[0-9]{2}(?::[0-9]{2})?|[0-9]{2}(?:[0-9]{2})?)"
_ZONE = r"[Zz]|UTC|[+-][0-9]{2}(?::?[0-9]{2})?"
_PATTERN = rf"(?P<date>{_DATE})[Tt ](?P<time>{_TIME})(?:[.,](?P<fraction>[0-9]{{1,18}}))? ?(?P<zone>{_ZONE})?"
_ISO = re.compile(_PATTERN)
_S = 1_000_000_000
EXAMPLE = "2026-03-01T12:00:00.000000001Z"
_MUST = f"a time must be a date like {EXAMPLE}"


def is_date(text: str) -> bool:
    """Whether a cell holds date and time."""
    return _ISO.fullmatch(text.strip()) is not None


class TextClock:
    """A column of time as text, block by block: numbers or dates, but not both.

    Dates with and without a zone do not mix either: nobody knows what separates them. Dates without one count as UTC;
    digits beyond nanoseconds are cut off.
    """

    def __init__(self, unit_ns: int | None, where: str) -> None:
        """Take the unit of numbers [ns], None for dates only, and what messages call the column."""
        self._unit_ns, self._where = unit_ns, where
        self._form: str | None = None

    def read(self, values: pa.Array, row: int) -> tuple[Stamps, Given]:
        """Stamps [ns], 0 where there is none, and where there is one; each of shape (q,).

        Args:
            values: text, null where there is none, shape (q,).
            row: row of the first one, for messages.

        Raises:
            InputError: a time is neither a number nor a date, of another form than the first one, or out of range.
        """
        values = pc.call_function("utf8_trim_whitespace", [values])
        if self._form is None and values.null_count < len(values):
            first = values.drop_null()[0].as_py()
            self._form = _form(first)
            if self._unit_ns is None and self._form == "number" and not _is_number(first):
                self._refuse(values, values.is_valid().to_numpy(zero_copy_only=False), row, _MUST)
        if self._form in (None, "number"):
            return from_text(values, self._unit_ns, self._where, row)
        return self._dates(values, row)

    def _dates(self, values: pa.Array, row: int) -> tuple[Stamps, Given]:
        given = values.is_valid().to_numpy(zero_copy_only=False)
        parts = pc.call_function("extract_regex", [values], pc.ExtractRegexOptions(f"^(?:{_PATTERN})$"))
        no_date = given & ~parts.is_valid().to_numpy(zero_copy_only=False)
        if no_date.any():
            self._refuse(values, no_date, row, f"{_MUST}, as the first one is")
        zone = _part(parts, "zone", "")
        zoned = pc.call_function("not_equal", [zone, pa.scalar("")]).to_numpy(zero_copy_only=False)
        if (other := given & (zoned != (self._form == "zone"))).any():
            which = "with a time zone" if self._form == "zone" else "without a time zone"
            self._refuse(values, other, row, f"all times must be {which}, as the first one is")
        date, clock = _digits(_part(parts, "date", "19700101")), _digits(_part(parts, "time", "00"))
        moment = _padded(date, 8) * 10**6 + _padded(clock, 6)
        below = _padded(_part(parts, "fraction", ""), 9)
        seconds = self._seconds(values, moment, row) - _zone_s(zone)
        beyond = np.abs(seconds) >= LARGEST_NS // _S
        if beyond.any():
            self._refuse(values, beyond, row, "it must be within 292 years of 1970")
        return np.where(given, seconds * _S + below, 0), given

    def _seconds(self, values: pa.Array, number: Stamps, row: int) -> Stamps:
        """Seconds of UTC from numbers of 14 digits each: year, month, day, hour, minute, second."""
        months, days, hours, minutes, seconds = (number // 10**k % 100 for k in (8, 6, 4, 2, 0))
        first = ((number // 10**10 - 1970) * 12 + months - 1).astype("datetime64[M]").astype("datetime64[D]")
        date = first + (days - 1)
        wrong = (months < 1) | (months > 12) | (date.astype("datetime64[M]") != first.astype("datetime64[M]"))
        wrong |= (hours > 23) | (minutes > 59) | (seconds > 59)
        if wrong.any():
            self._refuse(values, wrong, row, "there is no such date or time of day")
        return date.astype(np.int64) * 86_400 + hours * 3600 + minutes * 60 + seconds

    def _refuse(self, values: pa.Array, bad: Given, row: int, why: str) -> None:
        first = int(np.flatnonzero(bad)[0])
        raise InputError(f"{self._where} is {values[first].as_py()!r:.60} in row {row + first}; {why}")


def _form(text: str) -> str:
    """Whether a time is a number, or a date with or without a zone."""
    found = _ISO.fullmatch(text.strip())
    return "number" if found is None else "zone" if found["zone"] else "local"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _part(parts: pa.Array, name: str, default: str) -> pa.Array:
    """One group of the pattern, the default where there is none."""
    return pc.fill_null(pc.call_function("struct_field", [parts], pc.StructFieldOptions([name])), default)


def _digits(text: pa.Array) -> pa.Array:
    options = pc.ReplaceSubstringOptions("[^0-9]", "")
    return pc.call_function("replace_substring_regex", [text], options)


def _padded(digits: pa.Array, width: int) -> Stamps:
    """Digits as numbers, zeros added behind or digits left out there so that each has as many."""
    padded = pc.call_function("utf8_rpad", [digits], pc.PadOptions(width, "0"))
    cut = pc.call_function("utf8_slice_codeunits", [padded], pc.SliceOptions(0, width))
    return cut.cast(pa.int64()).to_numpy(zero_copy_only=False)


def _zone_s(zone: pa.Array) -> Stamps:
    """Seconds that clocks of each zone are ahead of UTC."""
    number = _padded(_digits(zone), 4)
    behind = pc.call_function("starts_with", [zone], pc.MatchSubstringOptions("-"))
    sign = np.where(behind.to_numpy(zero_copy_only=False), -1, 1)
    return sign * (number // 100 * 3600 + number % 100 * 60)
