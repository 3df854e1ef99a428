"""The text report of a diagnosis: verdict first, then what supports it, what it is worth and what stays open."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from discrepancy import rules
from discrepancy.causes.units import Shown, one_each, parameter
from discrepancy.digits import three_digits
from discrepancy.result.evidence_list import label
from discrepancy.result.read import kind_of, name_of
from discrepancy.result.remains import farthest, of_scatter, remains, remedy, sizes_of
from discrepancy.result.text_gain import gain_lines
from discrepancy.result.text_rollouts import rollout_lines

WIDTH = 100
Values = Mapping[str, Any]
NOTHING_WRONG_HERE = ("consistent", "miscalibrated")
"""Verdicts with which no place stands out."""
SAID = 0.001
"""Probabilities below are not told."""
NEAREST = 4
"""How many of what else it might be are told."""


def format_diagnosis(values: Values) -> str:
    """Readable report of at most 100 columns.

    Args:
        values: a diagnosis in the form of ``diagnosis_to_dict``.
    """
    lines = list(wrapped(_verdict(values), ""))
    for k, cause in enumerate(values["causes"], start=1):
        lines += [
            "",
            f"[[Cause {k}: {_heading(cause)} ({cause['cause']})]]",
            *cause_lines(cause, further=k > 1),
        ]
    lines += [*_suspected(values), *_scatter(values), *gain_lines(values), *rollout_lines(values)]
    notes = list(values["notes"])
    if values["not_simulated"] and not values["causes"]:
        notes.append(
            f"The closed loop was not simulated ({values['not_simulated']}), so what shows only in the response to "
            "the commands stays open."
        )
    if notes:
        lines += ["", "[[Notes]]"]
        for note in notes:
            lines += wrapped(note)
    lines += ["", "[[Residual]]", *(line for text in _residual(values) for line in wrapped(text))]
    if values["verdict"] in NOTHING_WRONG_HERE:
        lines += [
            "",
            "[[What would have been noticed, nine times in ten]]",
            *limit_lines(values["detection_limits"]),
        ]
    else:
        lines += ["", "[[What such recordings cannot decide]]"]
        for entry in values["undecidable"]:
            lines += wrapped(f"{entry['what']}: {entry['why']}; needs {entry['remedy']}.")
    return "\n".join(lines)


def _verdict(values: Values) -> str:
    causes, count = values["causes"], len(values["recordings"])
    data = "the recording" if count == 1 else f"the {count} recordings"
    named = " ".join(cause["sentence"] for cause in causes)
    open_ = " ".join(remains(values))
    if values["verdict"] == "consistent":
        return f"CONSISTENT. The simulation explains {data} within noise and tolerances; nothing is named. {open_}"
    if values["verdict"] == "miscalibrated":
        scatter = " ".join(entry["sentence"] for entry in values["scatter"])
        return (
            f"MISCALIBRATED. The robots of {data} are off by more than their tolerances, all places alike, so none is "
            f"named. {scatter} {remedy(values)} {open_}"
        )
    if values["verdict"] == "explained":
        return f"EXPLAINED. {named} {open_}"
    if values["verdict"] == "partly_explained":
        return f"PARTLY EXPLAINED. {named} That is not all. {open_}"
    said = f"UNEXPLAINED. {data[0].upper()}{data[1:]} and the simulation differ, and "
    also = " ".join(of_scatter(values))
    if causes:
        return f"{said}the catalogue's best explains little of it: {named} {also}"
    return f"{said}no cause of the catalogue explains it. {also}"


def _heading(cause: Values) -> str:
    """The cause at its place; of a law without its signals, which the sentence has."""
    return name_of(cause).partition(", by ")[0] if cause.get("law") else name_of(cause)


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


def _suspected(values: Values) -> Iterable[str]:
    if values["suspected"]:
        yield from ("", "[[Suspected: too improbable to be named]]")
    for entry in values["suspected"]:
        chance = probability_words(entry["probability"])
        yield from wrapped(f"{label(entry)} ({entry['cause']}), probability {chance}: {entry['sentence']}")


def _scatter(values: Values) -> Iterable[str]:
    if values["scatter"]:
        yield from ("", "[[Off at all places alike]]")
    for entry in values["scatter"]:
        yield from wrapped(
            f"{entry['kind']} ({entry['cause']}): {sizes_of(entry, 'spread')}, {_times(entry['factor'])} times the "
            f"tolerance; likelier than it by {entry['nats']:.0f} nats.{_farthest(entry)}"
        )


def _farthest(entry: Values) -> str:
    said = farthest(entry)
    return f" Farthest off: {said}." if said else ""


def _times(factor: float) -> str:
    return f"{factor:.0f}" if factor >= 10.0 else f"{factor:.1f}"


def _rival(rival: Values) -> str:
    loop = "" if rival["chi2_per_n"] is None else f", closed loop chi2/n {three_digits(rival['chi2_per_n'])}"
    gap = rival["evidence_gap"]
    return f"{name_of(rival)} ({abs(gap):.0f} nats {'worse' if gap >= 0 else 'better in the rows'}{loop})"


def _residual(values: Values) -> Iterable[str]:
    residual = values["residual"]
    text = (
        f"chi2/n is {three_digits(residual['nominal']['chi2_per_n'])} as simulated, "
        f"{three_digits(residual['chi2_per_n_tolerated'])} with nothing named and everything a little off, "
        "as far as its kind scatters"
    )
    if values["causes"] or values["suspected"]:
        text += f", {three_digits(residual['chi2_per_n'])} with what is {'named' if values['causes'] else 'suspected'}"
    elif f"{residual['chi2_per_n']:.3g}" != f"{residual['chi2_per_n_tolerated']:.3g}":
        text += f", {three_digits(residual['chi2_per_n'])} where what scatters does so by its own law"
    yield f"{text} (up to {rules.CLEAN_CHI2_PER_N:g} counts as clean)."
    if values["verdict"] != "consistent":
        yield f"As simulated: {residual['nominal']['signature']['sentence']}"
    if residual["chi2_per_n"] > rules.CLEAN_CHI2_PER_N or residual["unlisted_nats"] >= rules.UNLISTED_NATS:
        yield f"What is left: {residual['signature']['sentence']}"


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
