"""Results as Markdown tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from discrepancy.team.causes import CAUSES
from hidden.score import Score, score
from mocobot.campaign.summary import interval

Result = Mapping[str, Any]


def tables(results: Iterable[Result]) -> str:
    """All tables there are results for."""
    results = list(results)
    sound = [r for r in results if not r["error"]]
    parts: dict[str, list[Result]] = {}
    for result in sound:
        parts.setdefault(result["part"], []).append(result)
    out = [_alarms(parts)]
    singles = parts.get("single", [])
    for background in (False, True):
        chosen = [r for r in singles if bool(r["truth"]["background"]) is background]
        for factor in sorted({_factor(r) for r in chosen}):
            title = f"One effect at {factor:g} times the limit" + (
                ", tolerances besides" if background else ""
            )
            out.append(_singles(title, [r for r in chosen if _factor(r) == factor]))
    out.append(_singles("One effect at 4 times the limit of its log", parts.get("hidden-in-logs", [])))
    out += [_pairs(parts.get("pairs", [])), _left_out(parts.get("leave-one-out", []))]
    if len(sound) < len(results):
        out.append(f"{len(results) - len(sound)} sets ended in an error and are not counted.")
    return "\n\n".join(table for table in out if table)


def _factor(result: Result) -> float:
    return float(result["key"].split("-x")[1].split("-")[0])


def _alarms(parts: Mapping[str, Sequence[Result]]) -> str:
    rows = []
    for part, preset in product(("clean", "tolerance"), ("nominal", "ideal")):
        if runs := [r for r in parts.get(part, []) if ("-ideal-" in r["key"]) is (preset == "ideal")]:
            named = [r["verdict"]["found"] for r in runs]
            alarms = sum(bool(found) for found in named)
            low, high = interval(alarms, len(runs))
            causes = Counter(item["cause"] for found in named for item in found)
            what = ", ".join(f"{cause} {n}" for cause, n in causes.items()) or "-"
            share = f"{100 * low:.0f} .. {100 * high:.0f} %"
            others = _counts(Counter(v for r in runs if (v := r["verdict"]["verdict"]) != "consistent"))
            rows.append([f"{part}, {preset} sensors", len(runs), alarms, share, what, others])
    if runs := parts.get("logs", []):
        named = [r["verdict"]["found"] for r in runs]
        alarms = sum(r["verdict"]["verdict"] != "consistent" for r in runs)
        low, high = interval(alarms, len(runs))
        left = np.sort([r["verdict"]["after"] for r in runs])
        causes = Counter(item["cause"] for found in named for item in found)
        estimates = [(r["verdict"]["estimate"], r["truth"]["mass_kg"]) for r in runs]
        off = [(e["mass_kg"][0] - mass) / e["mass_kg"][1] for e, mass in estimates if e["mass_kg"]]
        contradicting = sum(bool(e["contradicts"]) for e, _ in estimates)
        rms = np.sqrt(np.mean(np.square(off)))
        what = (
            f"{_counts(causes)}; chi2/n {left[0]:.2f} .. {left[-1]:.2f}; mass off by {rms:.2f} "
            f"standard errors rms in {len(off)}, {contradicting} said to contradict themselves"
        )
        rows.append(["converted logs", len(runs), alarms, f"{100 * low:.0f} .. {100 * high:.0f} %", what, ""])
    header = ["sets", "number", "something named", "95 % interval", "what", "other verdicts than consistent"]
    return _markdown("False alarms", header, rows)


def _singles(title: str, runs: Sequence[Result]) -> str:
    by_cause: dict[str, list[tuple[Score, list[str]]]] = {}
    for result in runs:
        (one,), extras = score(result["verdict"], result["truth"])
        by_cause.setdefault(result["truth"]["effects"][0]["cause"], []).append((one, extras))
    rows = []
    for cause in (c for c in CAUSES if c in by_cause):
        rows.append([cause, *_row(cause, by_cause[cause])])
    if not rows:
        return ""
    rows.append(["**all**", *_row("", [pair for pairs in by_cause.values() for pair in pairs])])
    header = [
        "hidden",
        "sets",
        "family",
        "member",
        "ambiguous",
        "place",
        "error median",
        "worst",
        "rms over se",
    ]
    return _markdown(title, [*header, "missed", "named instead", "besides"], rows)


def _row(cause: str, pairs: Sequence[tuple[Score, list[str]]]) -> list[Any]:
    scores = [one for one, _ in pairs]
    errors = [100 * s.error for s in scores if s.error is not None]
    deviations = [z for s in scores for z in s.deviations]
    instead = Counter(s.named for s in scores if s.named and not s.member)
    besides = Counter(extra for _, extras in pairs for extra in extras)
    return [
        len(scores),
        sum(s.family for s in scores),
        sum(s.member for s in scores),
        sum(s.ambiguous for s in scores),
        sum(s.place for s in scores),
        f"{np.median(errors):.1f} %" if errors else "-",
        f"{max(errors):.1f} %" if errors else "-",
        f"{np.sqrt(np.mean(np.square(deviations))):.1f}" if deviations else "-",
        sum(s.named is None for s in scores),
        _counts(instead) if cause else sum(instead.values()),
        _counts(besides) if cause else sum(besides.values()),
    ]


def _counts(counter: Counter[Any]) -> str:
    return ", ".join(f"{name} {n}" for name, n in counter.items()) or "-"


def _pairs(runs: Sequence[Result]) -> str:
    if not runs:
        return ""
    both = one = none = placed = extra_sets = 0
    besides: Counter[str] = Counter()
    for result in runs:
        scores, extras = score(result["verdict"], result["truth"])
        right = sum(s.member or s.ambiguous for s in scores)
        both, one, none = both + (right == 2), one + (right == 1), none + (right == 0)
        placed += all(s.place for s in scores)
        extra_sets += bool(extras)
        besides.update(extras)
    row = [len(runs), both, placed, one, none, extra_sets, _counts(besides)]
    header = ["sets", "both causes right", "both places too", "one right", "none", "sets with a wrong one"]
    return _markdown("Two effects at 4 times the limit", [*header, "which"], [row])


def _left_out(runs: Sequence[Result]) -> str:
    rows = []
    total: Counter[str] = Counter()
    for cause in CAUSES:
        own = [r for r in runs if r["truth"]["effects"][0]["cause"] == cause]
        if own:
            counts = Counter(left_out_kind(r) for r in own)
            named = Counter(item["cause"] for r in own for item in r["verdict"]["found"])
            rows.append([cause, len(own), *(counts[kind] for kind in KINDS), _counts(named)])
            total.update(counts)
    if rows:
        rows.append(["**all**", len(runs), *(total[kind] for kind in KINDS), ""])
    return _markdown("True cause left out of the catalogue", ["hidden", "sets", *KINDS, "named"], rows)


VERDICTS = ("explained", "partly_explained", "unexplained")
KINDS = (
    *(f"{verdict}, {where}" for where in ("in family", "outside") for verdict in VERDICTS),
    "none named, unexplained",
    "none named, miscalibrated",
    "none named, consistent",
)


def left_out_kind(result: Result) -> str:
    """What became of a cause that is not in the catalogue."""
    verdict, family = result["verdict"], CAUSES[result["truth"]["effects"][0]["cause"]].family
    if not verdict["found"]:
        return f"none named, {verdict['verdict']}"
    inside = all(item["family"] == family for item in verdict["found"])
    return f"{verdict['verdict']}, {'in family' if inside else 'outside'}"


def _markdown(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    if not rows:
        return ""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
