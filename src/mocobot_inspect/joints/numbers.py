"""Shares and delays as the text has them."""

from math import floor, log10


def percent(share: float) -> str:
    """A share in percent, two digits, never as a power of ten where it is large."""
    value = 100.0 * share
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def milliseconds(delay_s: float, se_s: float) -> str:
    """A delay's size with its standard error of two digits."""
    digits = max(0, 1 - floor(log10(max(1e3 * se_s, 1e-3))))
    return f"{1e3 * abs(delay_s):.{digits}f} +- {1e3 * se_s:.{digits}f} ms"


def later(delay_s: float, se_s: float) -> str:
    """By how much one thing follows another, or comes before it."""
    if delay_s != delay_s:
        return "by a delay that noise hides"
    return f"{milliseconds(delay_s, se_s)} {'earlier' if delay_s < 0 else 'later'}"
