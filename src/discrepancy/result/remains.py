"""Sentences on what a verdict leaves open: remaining misfit and scatter."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from scipy.special import stdtrit

from discrepancy.numbers import one_each, parameter, three_digits
from discrepancy.result.read import is_of_joints, kind_of

VISIBLE_CHI2_PER_N = 3.0
"""Closed-loop chi2/n above which it is reported, and the deviations of healthy parts are simulated, too. Chosen."""

RESPONSE_SHARE = 0.8
"""Share of the response's excess error that causes must remove; below it, the rest is reported."""

Values = Mapping[str, Any]
FARTHEST = 3
"""Number of places of a kind to report."""


def remedy(values: Values) -> str:
    """Advice for a miscalibrated machine."""
    if is_of_joints(values):
        return "Correct the model by these values, and diagnose again with it."
    return 'Find the machine as it is ("mocobot calibrate" does so for a team), and diagnose again with that.'


def of_response(values: Values) -> list[str]:
    """A sentence on the remaining error of the simulated response to the commands."""
    gain = values["gain"]
    told = gain and (gain["held_out"]["after"] or gain["held_out"]["before"])
    if not told or told["chi2_per_n"] <= VISIBLE_CHI2_PER_N:
        return []
    left = three_digits(told["chi2_per_n"])
    if not values["causes"]:
        why = {
            "consistent": "tolerances, assumed or given, account for it, or what the other trials leave open of the "
            "payload, so nothing is named. Where several trials move, robots as designed do not answer like these: "
            "calibrate them, or give narrower tolerances",
            "miscalibrated": "robots as designed do not answer like these",
        }.get(values["verdict"], "nothing that is known accounts for it")
        said = f"The simulated response to the commands is off by chi2/n {left}, where noise alone leaves 1: {why}."
        return [said, *(f"It is by {found}." for found in all_as_found(gain))]
    removed = gain["removed"]
    if removed is not None and removed["share"] >= RESPONSE_SHARE:
        return []
    before = gain["held_out"]["before"]["chi2_per_n"]
    found = "".join(f", by {found}" for found in all_as_found(gain))
    return [
        f"With the named causes the simulated response to the commands is still off by chi2/n {left} "
        f"({three_digits(before)} without them; noise alone leaves 1){found}."
    ]


def all_as_found(gain: Values) -> list[str]:
    """Error of a simulation with all healthy parts at their fitted values, in words; empty if not requested."""
    told = gain["held_out"].get("as_found")
    if told is None:
        return []
    return [
        f"{three_digits(told['chi2_per_n'])} with every part as far off as it is found, within its tolerance, too"
    ]


def scatter_sentence(entry: Values) -> str:
    """A sentence on the spread of a kind with scatter."""
    kind = kind_of(entry)
    return (
        f"{kind[:1].upper()}{kind[1:]}: a spread of {sizes_of(entry, 'spread')} over {entry['places']} places "
        f"(tolerance {sizes_of(entry, 'tolerance')})."
    )


def farthest(entry: Values) -> str:
    """The places that deviate most, with their values, in words."""
    return ", ".join(
        f"{place['place']} ({_sizes(entry, {n: p['value'] for n, p in place['parameters'].items()})})"
        for place in entry.get("each", ())[:FARTHEST]
    )


def sizes_of(entry: Values, which: str) -> str:
    """``spread`` or ``tolerance`` of an entry in words, in the unit that fits the spread."""
    return _sizes(entry, entry[which])


def _sizes(entry: Values, sizes: Mapping[str, float]) -> str:
    shown = one_each((parameter(name)[1], size) for name, size in entry["spread"].items())
    said = []
    for name, size in sizes.items():
        words, unit = parameter(name)
        unit, scale = shown[unit]
        number = f"{scale * size:.2g} {unit}".rstrip()
        said.append(number if len(sizes) == 1 else f"{words} {number}")
    return ", ".join(said)


def excess_removed(chi2_per_n: Iterable[tuple[float, float]]) -> dict[str, Any] | None:
    """Share of the error beyond noise that is removed: mean over trials and 95 % interval (-inf to 1 for one trial).

    Args:
        chi2_per_n: chi2/n of each trial before and after; trials without excess error before are ignored.
    """
    excess = [[float(np.sqrt(max(x - 1.0, 0.0))) for x in pair] for pair in chi2_per_n if pair[0] > 1.0]
    shares = [1.0 - after / before for before, after in excess]
    if not shares:
        return None
    mean, count = float(np.mean(shares)), len(shares)
    half = float(stdtrit(count - 1, 0.975) * np.std(shares, ddof=1) / np.sqrt(count)) if count > 1 else np.inf
    return {"share": mean, "interval": [mean - half, min(1.0, mean + half)]}
