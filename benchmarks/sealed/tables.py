"""Results as Markdown tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mocobot.campaign.summary import interval, reliability
from sealed.backgrounds import BACKGROUNDS
from sealed.grounded import law_of_the_background
from sealed.payload_table import payload_header, payload_rows
from sealed.score import HEALTHY, Score, Scored, family_of, score

SIZES = ((0.0, 3.0, "2 to 3"), (3.0, 6.0, "3 to 6"), (6.0, np.inf, "6 and more"))


def tables(results: Iterable[Mapping[str, Any]]) -> str:
    """All tables there are results for."""
    results = list(results)
    scored = [score(result) for result in results if not result["error"]]
    by_kind: dict[str, list[Scored]] = {}
    for one in scored:
        by_kind.setdefault(one.result["set"]["kind"], []).append(one)
    out = [_alarms(by_kind.get("clean", []))]
    for kind, title in (("single", "One effect, catalogue's form"), ("forms", "One effect, other forms")):
        sets = by_kind.get(kind, [])
        out += [_by_size(title, sets), _by_name(title, sets)]
    out.append(_several([one for kind in ("pairs", "triples", "pushes") for one in by_kind.get(kind, [])]))
    nobody = [one for one in scored if one.scores and not any(s.listed for s in one.scores)]
    out += [_nobodys("Not in the catalogue", nobody), _laws(scored), _reliability(scored)]
    payloads = payload_rows(one.result for one in scored)
    out += [
        _markdown("Errors of the payload's estimate, before and after", payload_header(), payloads),
        _cost(scored),
    ]
    if failed := [result for result in results if result["error"]]:
        lines = Counter(result["error"].splitlines()[-1] for result in failed)
        out.append(
            "\n".join([f"{len(failed)} ended in an error:", *(f"- {n} x {e}" for e, n in lines.items())])
        )
    return "\n\n".join(table for table in out if table)


def _share(hits: int, of: int) -> str:
    if not of:
        return "-"
    low, high = interval(hits, of)
    return f"{hits} ({100 * low:.0f} .. {100 * high:.0f} %)"


def _background(one: Scored) -> str:
    return one.result["set"]["background"]


def _alarms(sets: Sequence[Scored]) -> str:
    rows = []
    for background in BACKGROUNDS:
        own = [one for one in sets if _background(one) == background]
        if not own:
            continue
        named = sum(bool(one.extras) for one in own)
        not_healthy = sum(one.verdict not in HEALTHY for one in own)
        what = Counter(item["cause"] for one in own for item in one.extras)
        there = Counter(item["cause"] for one in own for item in one.grounded)
        verdicts = Counter(one.verdict for one in own)
        shares = [_share(n, len(own)) for n in (named, not_healthy)]
        rows.append([background, len(own), *shares, _counts(verdicts), _counts(what), _counts(there)])
    header = [
        "robots", "sets", "a fault named", "a fault named, or unexplained", "verdicts", "named", "of the background",
    ]  # fmt: skip
    return _markdown("Nothing hidden", header, rows)


def _by_size(title: str, sets: Sequence[Scored]) -> str:
    rows = []
    for background in (*BACKGROUNDS, None):
        for low, high, label in (*SIZES, (0.0, np.inf, "all")):
            own = [
                one
                for one in sets
                if background in (None, _background(one)) and low <= one.scores[0].factor < high
            ]
            own = [one for one in own if one.scores[0].listed]
            if own and (background is None or label != "all"):
                rows.append([background or "**all**", label, *_line(own)])
    return _markdown(title, ["robots", "size over the limit", *LINE], rows)


def _by_name(title: str, sets: Sequence[Scored]) -> str:
    rows = []
    names = sorted({one.scores[0].effect["cause"] for one in sets if one.scores[0].listed})
    for name in names:
        own = [one for one in sets if one.scores[0].effect["cause"] == name]
        scores = [one.scores[0] for one in own]
        errors = [100.0 * s.error for s in scores if s.error is not None]
        deviations = [z for s in scores for z in s.deviations]
        rows.append(
            [
                name,
                *_line(own),
                f"{np.median(errors):.1f}, {max(errors):.1f}" if errors else "-",
                f"{np.sqrt(np.mean(np.square(deviations))):.1f} ({len(deviations)})" if deviations else "-",
            ]
        )
    header = ["hidden", *LINE, "error median, worst [%]", "rms of error over se (numbers)"]
    return _markdown(f"{title}, by name", header, rows)


LINE = ("sets", "family", "member", "and place", "missed", "named instead", "besides", "of the background")


def _line(own: Sequence[Scored]) -> list[Any]:
    scores = [one.scores[0] for one in own]
    count: Callable[[str], int] = lambda name: sum(getattr(s, name) for s in scores)  # noqa: E731
    instead = Counter(s.named for s in scores if s.named and not s.right)
    besides = Counter(item["cause"] for one in own for item in one.extras)
    there = Counter(item["cause"] for one in own for item in one.grounded)
    missed = sum(s.named is None for s in scores)
    shares = [count("family"), sum(s.member or s.ambiguous for s in scores), count("right")]
    return [
        len(own),
        *(_share(n, len(own)) for n in shares),
        missed,
        _counts(instead),
        _counts(besides),
        _counts(there),
    ]


def _several(sets: Sequence[Scored]) -> str:
    rows = []
    for kind in ("pairs", "triples", "pushes"):
        own = [one for one in sets if one.result["set"]["kind"] == kind]
        if own:
            right = [sum(s.right for s in one.scores) for one in own]
            every = sum(n == len(one.scores) for n, one in zip(right, own, strict=True))
            counts = Counter(right)
            besides = Counter(item["cause"] for one in own for item in one.extras)
            extra = sum(bool(one.extras) for one in own)
            rows.append([kind, len(own), _share(every, len(own)), _counts(counts), extra, _counts(besides)])
    header = ["sets", "number", "all right", "how many right: sets", "sets with a wrong one", "which"]
    return _markdown("Several effects", header, rows)


def _nobodys(title: str, sets: Sequence[Scored]) -> str:
    """Effects that the catalogue does not have: by nature, or because their cause was left out."""
    groups: dict[str, list[Scored]] = {}
    for one in sets:
        kind = one.result["set"]["kind"]
        name = " + ".join(s.effect["cause"] for s in one.scores)
        groups.setdefault(f"{kind}: {name}", []).append(one)
    rows = [[name, *_fate(own)] for name, own in sorted(groups.items())]
    for kind in sorted({one.result["set"]["kind"] for one in sets}):
        own = [one for one in sets if one.result["set"]["kind"] == kind]
        rows.append([f"**{kind}**", *_fate(own)])
    header = [
        "hidden",
        "sets",
        "verdicts",
        "none named",
        "in the family",
        "outside",
        "outside with over 50 %",
        "named",
    ]
    return _markdown(title, header, rows)


def _laws(scored: Sequence[Scored]) -> str:
    """Laws stated of unlisted effects, and of sets that have none."""
    rows, all_scores = [], [one.result for one in scored if "law_scores" in one.result]
    for kind in sorted({result["set"]["kind"] for result in all_scores}):
        sets = [result["law_scores"] for result in all_scores if result["set"]["kind"] == kind]
        own = [score for each in sets for score in each]
        stated = [score for score in own if score["stated"]]
        sizes = [score["amplitude"] for score in own if score["amplitude"] is not None]
        held = [score["held_out"] for score in stated if score["held_out"] is not None]
        counts = [
            _share(sum(bool(s[name]) for s in own), len(own))
            for name in ("stated", "place", "variable", "formula")
        ]
        one_right = _share(sum(any(s["formula"] for s in each) for each in sets), len(sets))
        size = f"{100 * np.median(sizes):.1f}, {100 * max(sizes):.0f}" if sizes else "-"
        gain = f"{100 * np.median(held):.0f}, {100 * min(held):.0f}" if held else "-"
        beside = sum(each[0]["beside"] > 0 for each in sets)
        there = sum(each[0]["grounded"] > 0 for each in sets)
        rows.append([kind, len(sets), len(own), *counts, one_right, size, gain, beside, there])
    header = [
        "", "sets", "unlisted effects", "a law stated", "place", "and signal", "and formula", "one of a set right",
        "size off, median, most [%]", "gain held out over in sample, median, least [%]",
        "sets with a wrong one besides", "with one of the background",
    ]  # fmt: skip
    text = [_markdown("Laws", header, rows)] if rows else []
    others = [one for one in scored if "law_scores" not in one.result]
    if others:
        false = [[not law_of_the_background(law, one.result["truth"]) for law in one.laws] for one in others]
        there = sum(bool(each) and not any(each) for each in false)
        text.append(
            f"A law stated where nothing unlisted was hidden: {_share(sum(map(any, false)), len(others))} of "
            f"{len(others)}, and {there} where only hysteresis of the background was."
        )
    return "\n\n".join(text)


def _fate(own: Sequence[Scored]) -> list[Any]:
    none = inside = outside = sure = 0
    for one in own:
        families = {family_of(s.effect) for s in one.scores}
        strangers = [item for item in one.extras if item["family"] not in families]
        none += not one.extras
        inside += bool(one.extras) and not strangers
        outside += bool(strangers)
        sure += any((item.get("probability") or 0.0) > 0.5 for item in strangers)
    verdicts = Counter(one.verdict for one in own)
    named = Counter(item["cause"] for one in own for item in one.extras)
    return [len(own), _counts(verdicts), none, inside, outside, sure, _counts(named)]


def _reliability(scored: Sequence[Scored]) -> str:
    stated = [pair for one in scored for pair in one.stated]
    if not stated:
        return ""
    found, rows = reliability(stated), []
    for one in found["bins"]:
        right, mean = one["right"], one["mean"]
        low, high = right["interval"]
        label = f"{100 * one['low']:.0f} to {100 * one['high']:.0f} %"
        inside = "yes" if low <= mean <= high else "no"
        rows.append([label, right["of"], f"{100 * mean:.1f} %", _share(right["hits"], right["of"]), inside])
    all_right = _share(found["right"], found["number"])
    rows.append(["**all**", found["number"], "", all_right, f"Brier {found['brier']:.4f}"])
    header = ["stated", "causes", "mean of it", "right", "within the band"]
    return _markdown("Stated probabilities", header, rows)


def _cost(scored: Sequence[Scored]) -> str:
    if not scored:
        return ""
    cpu = np.array([one.result["verdict"]["cpu_s"] for one in scored])
    memory = np.array([one.result["verdict"]["peak_gb"] for one in scored])
    engines = ", ".join(sorted({one.result["engine"] for one in scored}))
    whole = sum(one.whole for one in scored)
    costs = [f"{np.median(cpu):.1f}, {cpu.max():.1f}", f"{np.median(memory):.2f}, {memory.max():.2f}"]
    row = [len(scored), _share(whole, len(scored)), *costs, engines]
    header = ["sets", "wholly right", "CPU median, most [s]", "memory median, most [GB]", "engines"]
    return _markdown("All sets", header, [row])


def misses(results: Iterable[Mapping[str, Any]]) -> str:
    """Every set that is not wholly right, in a line: what was hidden, what was named."""
    lines = []
    for result in results:
        if result["error"]:
            lines.append(f"{result['key']}: {result['error'].splitlines()[-1]}")
            continue
        one = score(result)
        if not one.whole:
            named = [_named(item) for item in one.result["verdict"]["causes"]]
            hidden = [_hidden(s) for s in one.scores]
            left = one.result["verdict"]["residual"]["chi2_per_n"]
            lines.append(
                f"{result['key']}: hidden {'; '.join(hidden) or 'nothing'} | {one.verdict}: "
                f"{'; '.join(named) or 'nothing'} | chi2/n {left:.2f}"
            )
    return "\n".join(lines)


def _named(item: Mapping[str, Any]) -> str:
    where = "/".join(str(item[key]) for key in ("cause", "robot", "joint") if item.get(key) is not None)
    p = item.get("probability")
    return where if p is None else f"{where} ({100 * p:.0f} %)"


def _hidden(one: Score) -> str:
    effect, answer = one.effect, one.effect["answer"]
    where = "/".join(str(effect[key]) for key in ("robot", "joint") if effect.get(key) is not None)
    said = f" = {answer['cause']}" if answer["cause"] != effect["cause"] else ""
    return f"{effect['cause']}{said} at {where or 'the payload'} x{one.factor:.3g}{'' if one.right else ' (not found)'}"


def _counts(counter: Mapping[Any, int]) -> str:
    return ", ".join(f"{name} {n}" for name, n in sorted(counter.items(), key=str)) or "-"


def _markdown(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    if not rows:
        return ""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
