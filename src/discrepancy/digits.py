"""Numbers that may have any size, as sentences have them."""


def three_digits(value: float) -> str:
    """Three digits, without a power of ten where that is needless: ``0.98``, ``19.1``, ``12200``."""
    short = f"{value:.3g}"
    return f"{float(short):.10g}" if "e+" in short else short
