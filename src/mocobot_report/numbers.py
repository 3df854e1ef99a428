"""Format numbers, units and sentences for the page."""

import math
import re
from collections.abc import Sequence

from estimator.statistics import decimals

MINUS, PLUS_MINUS, NONE, THIN = "\u2212", "\u00b1", "\u2013", "\u00a0"
SUPERSCRIPTS = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)
LEAST = 0.001
"""Smallest probability that is printed as a number, because probabilities are not known more accurately. Chosen."""


def plain(value: float | None, digits: int = 3) -> str:
    """Format a number: ``0.00123``, ``11.7``, ``5.6 x 10^-5`` with superscripts, or a dash if there is none."""
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
    """Format value and standard error to the second digit of the error; without an error, to four digits and ""."""
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
    """Format value, standard error and unit in one text, such as ``11.67196 +- 0.00019 kg``."""
    shown, error = measured(value, se)
    text = f"{shown} {PLUS_MINUS}{THIN}{error}" if error else shown
    return f"{text}{THIN}{unit}" if unit and shown != NONE else text


def percent(share: float | None) -> str:
    """Format a share in percent, such as ``99 %``, with more digits near 0 and 100 %."""
    if share is None or not math.isfinite(share):
        return NONE
    value = 100.0 * share
    if abs(value) < 1.0:
        return f"{plain(value, 2)}{THIN}%"
    digits = 1 if 99.0 < value < 99.95 else 0
    return f"{_signed(f'{value:.{digits}f}')}{THIN}%"


def probability(value: float) -> str:
    """Format a probability in percent, limited to ``LEAST`` from 0 and 100 %."""
    if value < LEAST:
        return f"<{THIN}{100 * LEAST:g}{THIN}%"
    return f">{THIN}{100 * (1 - LEAST):g}{THIN}%" if value > 1.0 - LEAST else percent(value)


def without_percent(text: str) -> str:
    """Remove the percent sign, for columns with the unit in their head."""
    return text.removesuffix(f"{THIN}%")


def about(value: float) -> str:
    """Format a ratio with two digits and separated thousands, such as ``53 000``."""
    rounded = float(f"{value:.1e}")
    return f"{rounded:,.0f}".replace(",", THIN) if rounded >= 10 else plain(value, 2)


def size(count: int) -> str:
    """Format a number of bytes, such as ``1.4 MB``."""
    for unit, scale in (("MB", 1e6), ("kB", 1e3)):
        if count >= scale:
            return f"{count / scale:.1f}{THIN}{unit}"
    return f"{count}{THIN}B"


def counted(count: int, noun: str) -> str:
    """Format a count with its noun, such as ``1 trial`` or ``2 trials``."""
    return f"{count} {noun}{'s' * (count != 1)}"


def kinds_of(kinds: Sequence[str]) -> str:
    """Count the kinds of trials, such as ``2 random, 1 static``."""
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))


def spelled(unit: str) -> str:
    """Format a unit for print: ``kg m^2`` with a superscript, ``um`` with a Greek letter."""
    unit = re.sub(r"\bu(?=(m|rad|N m|s)\b)", "µ", unit)
    for ascii_power, shown in (("^2", "²"), ("^3", "³"), ("^4", "⁴")):
        unit = unit.replace(ascii_power, shown)
    return unit.replace(" ", THIN)


def spelled_text(text: str) -> str:
    """Format the units in brackets of a text, so that they have superscripts and do not wrap."""
    return re.sub(r"\[(.*?)\]", lambda m: f"[{spelled(m[1])}]", text)


def tidy(sentence: str, *, inside: bool = False) -> str:
    """Typeset a sentence of a result: signs for ``+-`` and powers, and a capital letter unless ``inside`` another."""
    text = sentence.replace(" +- ", f"\u00a0{PLUS_MINUS}\u00a0").replace("+-(", f"{PLUS_MINUS}(")
    text = text.replace("chi2/n", "chi²/n")
    text = re.sub(r"(?<![\w.])-(?=\d)", MINUS, text)
    text = re.sub(r"(?<=\d )u(?=m\b)", "µ", text).replace("rad^3", "rad³").replace("m^2", "m²")
    return text if inside else text[:1].upper() + text[1:]


def short_names(names: list[str]) -> list[str]:
    """Shorten names of trials to file names without suffix; equal names get a number."""
    out: list[str] = []
    for name in names:
        stem = re.split(r"[/\\]", name)[-1].removesuffix(".parquet") or "trial"
        numbered = (f"{stem} ({k})" if k > 1 else stem for k in range(1, len(names) + 2))
        out.append(next(shown for shown in numbered if shown not in out))
    return out


def _signed(text: str) -> str:
    return text.replace("-", MINUS)
