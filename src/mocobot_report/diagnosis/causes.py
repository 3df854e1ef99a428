"""What a diagnosis names, as tables: sizes, what supports them, and what else it might be."""

from collections.abc import Mapping, Sequence
from typing import Any

from discrepancy.causes.units import one_each, parameter
from discrepancy.result.read import name_of
from discrepancy.result.text import NEAREST, SAID
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import NONE, plain, spelled
from mocobot_report.blocks.prose import bullets, facts, folded, tidy, verdict
from mocobot_report.blocks.tables import Entry, Num, measurement, table, value
from mocobot_report.diagnosis.keys import cause_name, chance_of, share_of

Values = Mapping[str, Any]


def cause_tables(causes: Sequence[Values]) -> list[Node]:
    """What is named, what supports it, and what else it might be."""
    units = one_each(
        (_said(cause, name)[1], entry["value"])
        for cause in causes
        for name, entry in cause["parameters"].items()
    )
    sizes: list[list[Entry]] = []
    support: list[list[Entry]] = []
    for cause in causes:
        who = cause_name(name_of(cause), cause["cause"])
        # A number without an error that is 0 is of a form that the cause does not have.
        there = {name: of for name, of in cause["parameters"].items() if of["value"] or of["se"] is not None}
        for k, (name, entry) in enumerate(there.items()):
            words, unit = _said(cause, name)
            unit, scale = units[unit] if unit in ("s", "m", "rad", "m/N") else (unit, 1.0)
            se = None if entry["se"] is None else scale * entry["se"]
            shown = measurement(scale * entry["value"], se, spelled(unit))
            sizes.append([who if k == 0 else "", shown, words])
        shares = (Num(share_of(cause["explained"][kind])) for kind in ("in_sample", "held_out"))
        folds = cause["folds"]
        better = f"{sum(gain > 0 for gain in folds)} of {len(folds)}" if folds else NONE
        chance = Num(share_of(cause["probability"]))
        support.append([tidy(name_of(cause)), chance, *shares, Num(better)])
    if len(causes) > 1:
        each = ([cause["explained"][kind] for cause in causes] for kind in ("in_sample", "held_out"))
        sums = [Num(NONE) if None in shares else Num(share_of(sum(shares))) for shares in each]
        support.append(["All together", Num(""), *sums, Num("")])
    note = (
        "probability: that it is this cause, at this place; share of the misfit as simulated that a cause removes "
        "beyond those above it, so that shares add up; held out: fitted to the other trials"
    )
    supports = ["cause", "probability [%]", "in sample [%]", "held out [%]", "folds better"]
    return [
        table(
            "What is named", ["cause", "value ± standard error", "parameter"], sizes, groups=True, stack=True
        ),
        table("What supports it", supports, support, note=note, stack=True),
        *_rivals(causes),
        *_shapes(causes),
    ]


def _said(cause: Values, name: str) -> tuple[str, str]:
    """A parameter's name in words and its unit: a law brings its own, others carry theirs in the name."""
    law = cause.get("law")
    return (
        parameter(name) if law is None else (name.removesuffix("_rad").replace("_", " "), law["units"][name])
    )


def _rivals(causes: Sequence[Values]) -> list[Node]:
    rows: list[list[Entry]] = []
    farther: list[list[Entry]] = []
    advice: dict[str, None] = {}
    for cause in causes:
        alike = [rival for rival in cause["alternatives"] if rival["ambiguous"]]
        if alike:
            advice |= dict.fromkeys(text for entry in [cause, *alike] if (text := entry["separate"]))
        near, far = _apart(cause["alternatives"])
        named = tidy(name_of(cause))
        farther += [[named if k == 0 else "", *_rival(rival)] for k, rival in enumerate(far)]
        for rival in near:
            rows.append([named, *_rival(rival)])
            named = ""
        for which, words in (
            ("unlisted", "something unlisted"),
            ("nothing", "nothing at all"),
        ):
            behind = value(cause["over_nothing"] if which == "nothing" else None)
            rows.append([named, words, Num(chance_of(cause["instead"][which])), behind, Num(NONE)])
            named = ""
    head = ["named", "what else", "chance [%]", "behind [nats]", "loop chi²/n"]
    note = "probability and nats: by the rows; with that of the cause the probabilities add up to 100 %"
    out = [table("What else it might be", head, rows, note=note, groups=True, stack=True)]
    if farther:
        out.append(
            folded("What fits worse still", table("Farther behind", head, farther, groups=True, stack=True))
        )
    return [*out, verdict("warn", "What would tell them apart", bullets(list(advice)))] if advice else out


def _apart(rivals: Sequence[Values]) -> tuple[list[Values], list[Values]]:
    """What could be there instead and the nearest of what could not, which the report names, too; and the others."""
    near: list[Values] = []
    far: list[Values] = []
    for rival in rivals:
        likely = rival["ambiguous"] or rival["probability"] >= SAID
        worse = sum(not one["ambiguous"] for one in near)
        (near if likely or worse < NEAREST else far).append(rival)
    return near, far


def _rival(rival: Values) -> list[Entry]:
    """Its row but for whose it is."""
    said = "cannot be told apart" if rival["ambiguous"] else "fits worse"
    other = el("span", cause_name(name_of(rival), rival["cause"]), " ", el("em", said))
    gap, chi2 = value(rival["evidence_gap"]), value(rival["chi2_per_n"])
    return [other, Num(chance_of(rival["probability"])), gap, chi2]


def _shapes(causes: Sequence[Values]) -> list[Node]:
    """Numbers that change a cause's columns and were chosen, not fitted."""
    entries = []
    for cause in causes:
        named = ((*_said(cause, name), number) for name, number in cause["shape"].items())
        said = ", ".join(
            f"{words} {plain(number, 4)} {spelled(unit)}".rstrip() for words, unit, number in named
        )
        if said:
            entries.append((tidy(name_of(cause)), said))
    return [folded("Shape parameters", facts(entries))] if entries else []
