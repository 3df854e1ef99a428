"""Text report of a verdict: at most five sentences and one table, and details on request."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

from discrepancy.evidence.settings import SETTINGS
from discrepancy.formulas.law import OFF_BY
from discrepancy.numbers import Shown, number, one_each, parameter, three_digits
from discrepancy.result.read import VERDICTS, is_of_joints, kind_of, name_of
from discrepancy.result.remains import remedy
from discrepancy.result.tables import WIDTH, Values, gain_lines, rollout_lines

NOTHING_WRONG_HERE = ("consistent", "miscalibrated")
"""Verdicts without any outstanding place."""
SAID = 0.001
"""Probabilities below are not reported."""
NEAREST = 4
"""Number of alternatives to report."""


def cause_lines(cause: Values, *, further: bool) -> Iterable[str]:
    """Evidence for a cause and its alternatives; ``further``: it is not the first cause."""
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
    ruled_out: dict[str, Values] = {}  # a cause may act at several instants: keep the likeliest
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
    """Alternatives to a cause, likeliest first."""
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
    """One line for each cause with the smallest and largest limit over the places, in one unit per quantity."""
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
    """A share as in ``94 %``; one significant digit if it would round to zero."""
    if 0.0 < abs(share) < SAID / 100:
        return "less than 0.001 %"
    whole = f"{100 * share:.0f} %"
    return whole if share == 0.0 or whole not in ("0 %", "-0 %") else f"{100 * share:.1g} %"


def probability_words(probability: float) -> str:
    """A probability as in ``94 %``; more digits near 0 and 100 %."""
    if probability > 1.0 - SAID:
        return "above 99.9 %"
    if probability < SAID:
        return "below 0.1 %"
    return f"{100 * probability:.{1 if probability < 0.095 or probability > 0.99 else 0}f} %"


def wrapped(text: str, indent: str = "    ") -> Sequence[str]:
    """Wrap a text to lines of at most ``WIDTH`` columns."""
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def drawn(strongest: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Candidates with at least 1 nat; a log axis has no room for less."""
    return [entry for entry in strongest if entry["nats"] >= 1.0]


def label(entry: Mapping[str, Any]) -> str:
    """An entry in words, for a plot."""
    if entry["at"] is None:
        return name_of(entry)
    return f"{kind_of(entry)} (trial {entry['at'][0]}, {entry['at'][1]:.1f} s)"


def relation(entry: Mapping[str, Any], causes: Sequence[Mapping[str, Any]]) -> str:
    """Relation of an entry to the named causes: ``named``, same ``family``, or ``other``."""
    place = ("cause", "robot", "joint")
    if any(all(entry[key] == cause[key] for key in place) for cause in causes):
        return "named"
    return "family" if any(entry["family"] == cause["family"] for cause in causes) else "other"


MOST_NAMED = 4
"""Number of findings in the second sentence."""
MOST_ALIKE = 3
"""Number of alternative causes of one finding in that sentence."""
LEAST_NATS = 1.0
"""Gains below are not reported."""
MOST_PLACES = 12
"""Number of table rows for a kind with scatter."""
PLACES, WHATS, LEAST_WHAT, SIZES, GAP = 24, 34, 22, 38, "  "
"""Widest place and cause columns, narrowest cause column, width for sizes, and column separator."""
PARTS = "two joints|a (?:driven joint|joint|link|leg|robot|base|grasp)"
"""Machine parts in cause titles, which the table omits because the place column names them."""
COUNTS = ("trial", "last_trial")
"""Parameters that are counts."""
TOGETHER = "\N{NO-BREAK SPACE}"
"""Joins words that must stay on one line of a cell."""
Row = tuple[list[str], list[str], list[str], str]
"""Lines of the place, cause and size cells, and a probability."""


def format_verdict(values: Values, *, verbose: bool = False) -> str:
    """Format a verdict as text of at most 100 columns.

    Args:
        values: a verdict in the form of ``result.json``.
        verbose: whether to add alternatives, limits, rollouts, notes and evidence.
    """
    lines = [*wrapped(" ".join(_sentences(values, verbose=verbose)), ""), *_table(values, verbose=verbose)]
    if verbose:
        lines += _rest(values)
    return "\n".join(lines)


def _sentences(values: Values, *, verbose: bool) -> Iterable[str]:
    yield _verdict(values)
    if values["causes"]:
        yield _found(values)
    yield from values["remains"][:1]
    yield from _gain(values)
    yield from _advice(values, verbose=verbose)


def _verdict(values: Values) -> str:
    verdict, count, named = values["verdict"], len(values["recordings"]), len(values["causes"])
    word = VERDICTS[verdict].upper()
    word = word if values["finished"] else f"UNFINISHED, SO FAR {word}"
    data = "the trial" if count == 1 else f"the {count} trials"
    account = "one finding accounts for" if named == 1 else f"{named} findings account for"
    wrong = f"what {'has changed' if values['reference'] else 'the model gets wrong'} in {data}"
    nothing = f"the model explains {data} within noise and tolerances"
    said = {
        "consistent": f"nothing but noise has changed in {data}" if values["reference"] else nothing,
        "miscalibrated": f"in {data} all places of a kind are off by more than their tolerances",
        "explained": f"{account} {wrong}",
        "partly_explained": f"{account} a part of {wrong}",
        "unexplained": f"no cause of the tables accounts for {wrong}",
    }[verdict]
    return f"{word}: {said}."


def _found(values: Values) -> str:
    names = [_either(cause) for cause in values["causes"][:MOST_NAMED]]
    more = len(values["causes"]) - len(names)
    if more:
        names.append(f"{more} more")
    between = "; " if any(" or " in name for name in names) else ", "
    listed = (
        names[0] if len(names) == 1 else f"{between.join(names[:-1])}{between.rstrip(', ')} and {names[-1]}"
    )
    than = "the reference" if values["reference"] else "its model"
    return f"The {'robot' if is_of_joints(values) else 'team'} differs from {than} by {listed}."


def _either(cause: Values) -> str:
    """Names of the smallest set with 90 % of the probability, likeliest first, and of the fitted cause."""
    names = list(dict.fromkeys(entry["name"] for entry in (*cause["told"], cause)))
    return " or ".join(names) if len(names) <= MOST_ALIKE else f"{names[0]} or {len(names) - 1} others"


def _gain(values: Values) -> Iterable[str]:
    gain = values["gain"]
    if gain is None or not values["causes"]:
        return
    if not (gain["validated"] if is_of_joints(values) else values["recordings"][1:]):
        yield "There is one trial only, so the findings are not tested on data left out of the fit."
    elif not is_of_joints(values):
        yield from _likelier([cause["folds"] for cause in values["causes"] if cause["folds"]])
    elif gain["removed"] is not None:
        share = gain["removed"]["share"]
        they = "it removes" if len(values["causes"]) == 1 else "they remove"
        if share > 0.0:
            yield f"In trials left out of the fit {they} {100.0 * share:.0f} % of the torques' error beyond noise."
        else:
            yield "In trials left out of the fit the torques' error is no smaller with that."


def _likelier(folds: Sequence[Sequence[float]]) -> Iterable[str]:
    """Log odds that lasting findings gain in trials predicted from the others."""
    if folds:
        each = [sum(gains) for gains in zip(*folds, strict=True)]
        better = sum(gain > 0.0 for gain in each)
        yield (
            f"Predicted by the others, {better} of {len(each)} trials are likelier with that, all together by "
            f"{sum(each):.0f} nats."
        )


def _advice(values: Values, *, verbose: bool) -> Iterable[str]:
    open_ = [cause for cause in values["causes"] if len(cause["told"]) > 1 and cause["separate"]]
    if not values["finished"]:
        yield "Let the search come to its end before you rely on this."
    elif open_:
        yield f"To decide what {open_[0]['place']} has: {_lower(open_[0]['separate'])}"
    elif values["verdict"] == "miscalibrated":
        yield remedy(values)
    elif values["verdict"] == "explained":
        yield "Correct the model by the values below, or repair the robot there."
    elif values["verdict"] == "consistent":
        if values["detection_limits"]:
            yield f"What would have been noticed is listed {'below' if verbose else 'with --verbose'}."
    else:
        what = (
            "position and load the torques part" if is_of_joints(values) else "place and load the rows part"
        )
        yield f"The page that `mocobot report` makes of the folder of --out shows at which speed, {what}."


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


# --- table


def _table(values: Values, *, verbose: bool) -> list[str]:
    named = [row for cause in values["causes"] for row in _rows(cause, verbose=verbose)]
    off = [row for entry in values["scatter"] for row in _scattered(entry)]
    suspected = [row for cause in values["suspected"] for row in _rows(cause, verbose=verbose)]
    rows = [*named, *off, *suspected]
    if not rows:
        return []
    head: Row = (["place"], ["what"], ["size +- standard error"], "probability")
    widths = [max(len(line) for row in (head, *rows) for line in row[k]) for k in range(3)]
    last = max(len(row[3]) for row in (head, *rows))
    widths[:2] = [min(widths[0], PLACES), min(widths[1], WHATS)]
    room = WIDTH - widths[0] - last - 3 * len(GAP)
    widths[1] = max(min(widths[1], room - min(widths[2], SIZES)), min(widths[1], LEAST_WHAT))
    widths[2] = min(widths[2], room - widths[1])
    across = sum(widths) + last + 3 * len(GAP)
    lines = ["", *_lines(head, widths, last), "-" * across]
    lines += [line for row in (*named, *off) for line in _lines(row, widths, last)]
    if suspected:
        lines.append("-- suspected, too improbable to be named ".ljust(across, "-"))
        lines += [line for row in suspected for line in _lines(row, widths, last)]
    return lines


def _lines(row: Row, widths: Sequence[int], last: int) -> Iterable[str]:
    """Format a row; text that is too wide for its column continues on the next line."""
    cells = [[part for line in row[k] for part in _folded(line, widths[k])] for k in range(3)]
    for i, parts in enumerate(zip_longest(*cells, fillvalue="")):
        padded = (
            f"{part.replace(TOGETHER, ' '):<{width}}" for part, width in zip(parts, widths, strict=True)
        )
        yield f"{GAP.join(padded)}{GAP}{row[3] if i == 0 else '':>{last}}".rstrip()


def _folded(line: str, width: int) -> list[str]:
    return textwrap.wrap(line, width, subsequent_indent="  ", break_on_hyphens=False) or [""]


def _rows(cause: Values, *, verbose: bool) -> Iterable[Row]:
    """Table rows of a finding; a finding with several members has a row for each."""
    what, chance = _whats(cause), _chance(cause["probability"])
    members = cause.get("members") or [cause]
    if len(members) == 1:
        event, numbers = cause.get("event"), members[0]["parameters"]
        told = event or {}
        sizes = _sizes({name: x for name, x in numbers.items() if name not in told}, verbose=verbose)
        if cause.get("law"):  # a formula says more than its parameters
            sizes = [cause["sentence"].partition(OFF_BY)[2].removesuffix(".")]
        if event:
            sizes.append(f"trial {event['trial']}, {event['start_s']:.2f} s, for {event['duration_s']:.2f} s")
        yield [cause["place"]], what, sizes or [""], chance
    else:
        yield from _each(cause["place"], what, members, chance)


def _scattered(entry: Values) -> Iterable[Row]:
    what = [_what(entry["kind"]), f"{entry['factor']:.1f} times the tolerance"]
    members = entry["each"][:MOST_PLACES]
    yield from _each(f"{entry['places']} places", what, members, "")
    if entry["places"] > len(members):
        yield [f"  and {entry['places'] - len(members)} more"], [""], [""], ""


def _each(place: str, what: list[str], members: Sequence[Values], chance: str) -> Iterable[Row]:
    """A heading and a row for each place; units are in the heading if all places have the same parameters."""
    names = {tuple(member["parameters"]) for member in members}
    shown = one_each(
        (parameter(name)[1], entry["value"])
        for member in members
        for name, entry in member["parameters"].items()
    )
    heading = [_named(name, shown) for name in members[0]["parameters"]] if len(names) == 1 else []
    yield [place], what, [", ".join(heading)], chance
    for member in members:
        numbers = [
            _number(name, entry, shown, named=not heading, unit=False)
            for name, entry in member["parameters"].items()
        ]
        yield [f"  {member['place']}"], [""], [f"  {', '.join(numbers)}"], ""


def _what(kind: str) -> str:
    """A cause in words without its place."""
    return re.sub(rf" (in|of|at) ({PARTS})\b", "", kind)


def _whats(cause: Values) -> list[str]:
    """The fitted cause, and the other causes in the smallest set with 90 % of the probability."""
    chances = {rival["name"]: rival["probability"] for rival in cause["alternatives"]}
    others = [entry for entry in cause["told"] if entry["name"] != cause["name"]]
    what = _what(cause["kind"])
    out = [what if len(others) < max(len(cause["told"]), 1) else f"(fitted as {what})"]
    for entry in others:
        unlisted = entry["cause"] == "unlisted"
        chance = cause["instead"]["unlisted"] if unlisted else chances.get(entry["name"])
        share = "" if chance is None else f" ({_chance(chance).replace(' ', TOGETHER)})"
        out.append(f"or {'something unlisted' if unlisted else entry['name']}{share}")
    return out


def _chance(probability: float) -> str:
    return probability_words(probability).replace("above", ">").replace("below", "<")


def _sizes(parameters: Values, *, verbose: bool) -> list[str]:
    """Parameters of one place, one line each; vectors on one line; moments of inertia only if ``verbose``."""
    shown = one_each((parameter(name)[1], entry["value"]) for name, entry in parameters.items())
    vectors: dict[str, list[str]] = {}
    for name, entry in parameters.items():
        absent = (
            entry["value"] == 0.0 and entry["se"] is None
        )  # chosen, such as a second length of one pendulum
        if verbose or not (absent or name.startswith("inertia_")):
            vectors.setdefault(re.sub(r"(^|_)[xyz]_", r"\1*_", name), []).append(name)
    out = []
    for stem, names in vectors.items():
        numbers = [_number(name, parameters[name], shown, named=len(names) == 1 < len(parameters),
                           unit=len(names) == 1) for name in names]  # fmt: skip
        if len(names) == 1:
            out += numbers
        else:
            axes = ", ".join(re.findall(r"(?:^|_)([xyz])_", "|".join(names).replace("|", "_")))
            word = parameter(stem.replace("*_", "", 1))[0] if stem[0] != "*" else ""
            out.append(f"{f'{word} {axes}'.strip()}: {', '.join(numbers)} {_unit(names[0], shown)[0]}")
    return out


def _unit(name: str, shown: Mapping[str, tuple[str, float]]) -> tuple[str, float]:
    unit = parameter(name)[1]
    if name in COUNTS:
        return "", 1.0
    return shown[unit] if unit else ("%", 100.0)


def _named(name: str, shown: Mapping[str, tuple[str, float]]) -> str:
    return f"{_word(name)} [{_unit(name, shown)[0]}]".replace(" ", TOGETHER)


def _number(
    name: str, entry: Values, shown: Mapping[str, tuple[str, float]], *, named: bool, unit: bool = True
) -> str:
    said, scale = _unit(name, shown)
    text = number(entry["value"], entry["se"], said if named or unit else "", scale)
    return (f"{_word(name)} {text}" if named else text).replace(" ", TOGETHER)


def _word(name: str) -> str:
    word = parameter(name)[0].replace("coulomb", "Coulomb")
    return word if word != "more" else "viscous" if "_per_" in name else "Coulomb"


# --- details


def _rest(values: Values) -> Iterable[str]:
    for k, cause in enumerate(values["causes"], start=1):
        yield from ("", f"[[{cause['name'][:1].upper()}{cause['name'][1:]} ({cause['cause']})]]")
        yield from (*wrapped(cause["sentence"]), *cause_lines(cause, further=k > 1))
    yield from _section("Suspected: too improbable to be named", map(_suspicion, values["suspected"]))
    yield from (*gain_lines(values), *rollout_lines(values))
    for which, what in (("before", "nothing found"), ("after", "that")):
        offers = [entry for entry in values["evidence"][which] or () if entry["nats"] >= LEAST_NATS]
        listed = ", ".join(f"{label(entry)} {entry['nats']:.0f} nats" for entry in offers)
        title = f"What one more cause would gain, with {what} in the model"
        yield from _section(title, [f"{listed}."] if listed else [])
    yield from _section("Misfit", [_misfit(values), *values["remains"]])
    if values["detection_limits"]:
        when = "have been noticed" if values["verdict"] in NOTHING_WRONG_HERE else "be noticed besides"
        yield from ("", f"[[What would {when}, nine times in ten]]", *limit_lines(values["detection_limits"]))
    open_ = (f"{entry['what']}: {entry['why']}; needs {entry['remedy']}." for entry in values["undecidable"])
    yield from _section("What such logs cannot decide", open_)
    why = values["not_simulated"]
    yield from _section(
        "Notes", [*values["notes"], *([f"The closed loop was not simulated: {why}."] if why else [])]
    )


def _section(title: str, texts: Iterable[str]) -> Iterable[str]:
    lines = [line for text in texts for line in wrapped(text)]
    return ["", f"[[{title}]]", *lines] if lines else []


def _suspicion(entry: Values) -> str:
    chance = probability_words(entry["probability"])
    return f"{label(entry)} ({entry['cause']}), probability {chance}: {entry['sentence']}"


def _misfit(values: Values) -> str:
    residual = values["residual"]
    text = f"chi2/n is {three_digits(residual['nominal']['chi2_per_n'])} as modelled, "
    far = "as far as its kind scatters" if values["scatter"] else "within its tolerance"
    text += f"{three_digits(residual['chi2_per_n_tolerated'])} with all a little off, {far}"
    if values["causes"]:
        text += f", {three_digits(residual['chi2_per_n'])} with what is found"
    return f"{text} (up to {SETTINGS.clean_chi2:g} counts as clean)."
