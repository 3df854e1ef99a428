"""What a verdict leaves open: figures that would contradict it if nothing were said of them."""

from collections.abc import Mapping
from typing import Any

from discrepancy import rules

Values = Mapping[str, Any]


def remains(values: Values) -> list[str]:
    """Sentences on the misfit, the tolerances and the response that are left; none where all is clean.

    Args:
        values: a diagnosis as ``discrepancy.result.json`` documents it, of this version or an earlier one.
    """
    residual = values["residual"]
    out = []
    if residual["chi2_per_n"] > rules.CLEAN_CHI2_PER_N:
        before = residual["nominal"]["chi2_per_n"]
        out.append(
            f"A misfit of chi2/n {residual['chi2_per_n']:.3g} remains of {before:.3g}, where up to "
            f"{rules.CLEAN_CHI2_PER_N:g} is clean: {residual['signature']['sentence'].rstrip('.')}."
        )
    strained = residual["tolerances"]["log10_p"]
    if strained <= rules.SIGNIFICANT_LOG10_P:
        out.append(
            f"Tolerances are used harder than healthy robots use them (by chance once in 10^{-strained:.0f}), which is "
            "no explanation."
        )
    return out + _of_response(values)


def _of_response(values: Values) -> list[str]:
    gain = values["gain"]
    told = gain and (gain["held_out"]["after"] or gain["held_out"]["before"])
    if not told or told["chi2_per_n"] <= rules.VISIBLE_CHI2_PER_N:
        return []
    left = f"{told['chi2_per_n']:.3g}"
    if not values["causes"]:
        why = (
            "tolerances, assumed or given, account for it, so nothing is named; but robots as designed do not answer "
            "like these: calibrate them, or give narrower tolerances"
            if values["verdict"] == "consistent"
            else "nothing that is known accounts for it"
        )
        return [
            f"The simulated response to the commands is off by chi2/n {left}, where noise alone leaves 1: {why}."
        ]
    removed = gain["removed"]
    if removed is not None and removed["share"] >= rules.RESPONSE_SHARE:
        return []
    before = gain["held_out"]["before"]["chi2_per_n"]
    return [
        f"With the named causes the simulated response to the commands is still off by chi2/n {left} ({before:.3g} "
        "without them; noise alone leaves 1)."
    ]
