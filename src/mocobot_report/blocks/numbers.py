"""Numbers as people read them: as many digits as the standard error has meaning, units that fit their size."""

import math
import re

from estimator.statistics import decimals

MINUS, PLUS_MINUS, NONE, THIN = "\u2212", "\u00b1", "\u2013", "\u00a0"
SUPERSCRIPTS = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)


def plain(value: float | None, digits: int = 3) -> str:
    """``0.00123``, ``11.7``, ``5.6 x 10^-5`` with superscripts; a dash where there is no number."""
    if value is None or not math.isfinite(value):
        return NONE
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -4 <= power < 6:
        mantissa = _signed(f"{value / 10.0**power:.{digits - 1}f}")
        return f"{mantissa}{THIN}×{THIN}10{str(power).translate(SUPERSCRIPTS)}"
    return _signed(f"{value:.{max(0, digits - 1 - power)}f}")


def measured(value: float | None, se: float | None) -> tuple[str, str]:
    """Value and standard error, both to the second digit of the error; without one, four digits and an empty text."""
    if value is None or not math.isfinite(value):
        return NONE, ""
    if se is None or not math.isfinite(se) or se <= 0:
        return plain(value, 4), ""
    digits = decimals(se)
    if digits > 9:  # too fine for a fixed point
        return plain(value, 4), plain(se, 2)
    rounded = round(value, digits)
    return _signed(f"{rounded:.{max(0, digits)}f}"), f"{round(se, digits):.{max(0, digits)}f}"


def with_error(value: float | None, se: float | None, unit: str = "") -> str:
    """``11.67196 +- 0.00019 kg`` in one text."""
    shown, error = measured(value, se)
    text = f"{shown} {PLUS_MINUS}{THIN}{error}" if error else shown
    return f"{text}{THIN}{unit}" if unit and shown != NONE else text


def percent(share: float | None) -> str:
    """``99 %``; more digits near 0 and 100 %."""
    if share is None or not math.isfinite(share):
        return NONE
    value = 100.0 * share
    if abs(value) < 1.0:
        return f"{plain(value, 2)}{THIN}%"
    digits = 1 if 99.0 < value < 99.95 else 0
    return f"{_signed(f'{value:.{digits}f}')}{THIN}%"


def about(value: float) -> str:
    """A ratio of two digits, thousands apart: ``53 000``."""
    rounded = float(f"{value:.1e}")
    return f"{rounded:,.0f}".replace(",", THIN) if rounded >= 10 else plain(value, 2)


def size(count: int) -> str:
    """``1.4 MB``."""
    for unit, scale in (("MB", 1e6), ("kB", 1e3)):
        if count >= scale:
            return f"{count / scale:.1f}{THIN}{unit}"
    return f"{count}{THIN}B"


def spelled(unit: str) -> str:
    """A unit as printed: ``kg m^2`` with a superscript, ``um`` with a Greek letter."""
    unit = re.sub(r"\bu(?=(m|rad|N m|s)\b)", "µ", unit)
    for ascii_power, shown in (("^2", "²"), ("^3", "³"), ("^4", "⁴")):
        unit = unit.replace(ascii_power, shown)
    return unit.replace(" ", THIN)


def _signed(text: str) -> str:
    return text.replace("-", MINUS)
