"""Lines of a report: what supports a cause, and what would have been noticed."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from discrepancy.numbers import Shown, one_each, parameter, three_digits
from discrepancy.result.read import kind_of, name_of

WIDTH = 100
Values = Mapping[str, Any]
NOTHING_WRONG_HERE = ("consistent", "miscalibrated")
"""Verdicts with which no place stands out."""
SAID = 0.001
"""Probabilities below are not told."""
NEAREST = 4
"""How many of what else it might be are told."""


def cause_lines(cause: Values, *, further: bool) -> Iterable[str]:
    """What supports a cause, and what else may be in its place; ``further``: it is not the first."""
    more = "a further " if further else ""
    explained = f"Explains {more}{_percent(cause['explained']['in_sample'])} of the misfit in sample"
    if cause["explained"]["held_out"] is not None:
        explained += f", {_percent(cause['explained']['held_out'])} on held-out trials"
    if cause["folds"]:
        better = sum(gain > 0 for gain in cause["folds"])
        explained += f" (a gain on {better} of {len(cause['folds'])} folds)"
    over = (
        ""
        if cause["over_nothing"] is None
        else f", {cause['over_nothing']:.0f} nats over nothing in its place"
    )
    yield from wrapped(
        f"Probability {probability_words(cause['probability'])}{over}{_else(cause)}. {explained}."
    )
    alike = [rival for rival in cause["alternatives"] if rival["ambiguous"]]
    ruled_out: dict[str, Values] = {}  # the likeliest of those that may act at several instants
    for rival in cause["alternatives"]:
        if not rival["ambiguous"]:
            ruled_out.setdefault(name_of(rival), rival)
    if alike:
        names = ", ".join(f"{name_of(rival)} by {rival['evidence_gap']:.1f} nats" for rival in alike)
        yield from wrapped(f"Cannot be told from: {names}.")
        advice = dict.fromkeys(text for rival in [cause, *alike] if (text := rival["separate"]))
        yield from wrapped("To tell them apart: " + " ".join(advice)) if advice else ()
    if ruled_out:
        yield from wrapped("Fits worse: " + ", ".join(map(_rival, list(ruled_out.values())[:NEAREST])) + ".")
    if not cause["alternatives"]:
        yield from wrapped("No other cause comes near.")


def _else(cause: Values) -> str:
    """What else may be in its place, the likeliest first."""
    instead = cause["instead"]
    others = [(rival["probability"], name_of(rival)) for rival in cause["alternatives"]]
    others += [
        (instead["unlisted"], "something unlisted that looks like it"),
        (instead["nothing"], "nothing"),
    ]
    likely = sorted((pair for pair in others if pair[0] >= SAID), key=lambda pair: -pair[0])[:NEAREST]
    told = ", ".join(f"{name} ({probability_words(share)})" for share, name in likely)
    return f"; else {told}" if told else ""


def _rival(rival: Values) -> str:
    loop = "" if rival["chi2_per_n"] is None else f", closed loop chi2/n {three_digits(rival['chi2_per_n'])}"
    gap = rival["evidence_gap"]
    return f"{name_of(rival)} ({abs(gap):.0f} nats {'worse' if gap >= 0 else 'better in the rows'}{loop})"


def limit_lines(limits: Sequence[Values]) -> Iterable[str]:
    """One line per cause: each parameter's smallest and largest limit over the places, in one unit per quantity."""
    sizes: dict[str, dict[str, list[float | None]]] = {}
    kinds = {entry["cause"]: kind_of(entry) for entry in limits}
    for entry in limits:
        for name, size in entry["parameters"].items():
            sizes.setdefault(entry["cause"], {}).setdefault(name, []).append(size)
    shown = one_each(
        (parameter(name)[1], size)
        for parameters in sizes.values() for name, values in parameters.items() for size in values if size is not None
    )  # fmt: skip
    for cause, parameters in sizes.items():
        each = ", ".join(_range(*parameter(name), values, shown) for name, values in parameters.items())
        yield from wrapped(f"{kinds[cause]} ({cause}): {each}")


def _range(words: str, unit: str, sizes: Sequence[float | None], shown: Mapping[str, Shown]) -> str:
    seen = sorted(size for size in sizes if size is not None)
    if not seen:
        return f"{words} never"
    unit, scale = shown[unit]
    low, high = f"{scale * seen[0]:.2g}", f"{scale * seen[-1]:.2g}"
    both = low if low == high else f"{low} to {high}"
    return f"{words} {both} {unit}".rstrip() + (" (not everywhere)" if len(seen) < len(sizes) else "")


def _percent(share: float) -> str:
    """``94 %``; a digit of what would round to none."""
    if 0.0 < abs(share) < SAID / 100:
        return "less than 0.001 %"
    whole = f"{100 * share:.0f} %"
    return whole if share == 0.0 or whole not in ("0 %", "-0 %") else f"{100 * share:.1g} %"


def probability_words(probability: float) -> str:
    """``94 %``; more digits near 0 and 100 %."""
    if probability > 1.0 - SAID:
        return "above 99.9 %"
    if probability < SAID:
        return "below 0.1 %"
    return f"{100 * probability:.{1 if probability < 0.095 or probability > 0.99 else 0}f} %"


def wrapped(text: str, indent: str = "    ") -> Sequence[str]:
    """Lines of at most ``WIDTH`` columns."""
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def drawn(strongest: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Candidates with at least 1 nat; less is nothing on a scale of multiples."""
    return [entry for entry in strongest if entry["nats"] >= 1.0]


def label(entry: Mapping[str, Any]) -> str:
    """An entry in words, for a plot."""
    if entry["at"] is None:
        return name_of(entry)
    return f"{kind_of(entry)} (trial {entry['at'][0]}, {entry['at'][1]:.1f} s)"


def relation(entry: Mapping[str, Any], causes: Sequence[Mapping[str, Any]]) -> str:
    """What an entry is to the named causes: ``named``, of their ``family``, or ``other``."""
    place = ("cause", "robot", "joint")
    if any(all(entry[key] == cause[key] for key in place) for cause in causes):
        return "named"
    return "family" if any(entry["family"] == cause["family"] for cause in causes) else "other"
