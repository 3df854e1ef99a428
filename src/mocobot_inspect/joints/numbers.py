"""Shares and delays as the text has them."""


def percent(share: float) -> str:
    """A share in percent, two digits, never as a power of ten where it is large."""
    value = 100.0 * share
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def later(delay_s: float) -> str:
    """By how much one thing follows another, or comes before it."""
    return f"{1e3 * abs(delay_s):.3g} ms {'earlier' if delay_s < 0 else 'later'}"
