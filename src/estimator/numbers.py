"""Values with their standard errors as text: as many digits as the error has meaning."""

import math


def decimals(se: float) -> int:
    """Decimals down to the second digit of a standard error, finite and above 0; negative above 100."""
    return 1 - math.floor(math.log10(se))


def measured(value: float, se: float) -> tuple[str, str]:
    """Value and standard error, both to the second digit of the error, with 0 to 9 decimals."""
    digits = min(max(decimals(se), 0), 9)
    return f"{value:.{digits}f}", f"{se:.{digits}f}"
