"""Results as Markdown tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mocobot.campaign.summary import interval
from scoring import log_score, median_and_most
from sealed.score import Score, Scored, score

SIZES = ((0.0, 3.0, "below 3 limits"), (3.0, np.inf, "3 limits and more"))
HEAD = (
    "row", "sets", "hidden effects told", "and with formula", "sets wholly right", "falsely certain", "log score",
    "chi2/n left", "CPU median, most [s]", "memory median, most [GB]", "errors",
)  # fmt: skip
Result = Mapping[str, Any]


def tables(results: Iterable[Result]) -> str:
    """All tables there are results for."""
    results = list(results)
    scored = [score(result) for result in results if not result["error"]]
    each = [
        _markdown("Rows", HEAD, [_line(name, own) for name, own in rows_of(results).items()]),
        _markdown("Effects by name", NAMES, _by_name(scored)),
        "\n".join(f"{n} x {error}" for error, n in _failures(results).items()),
    ]  # fmt: skip
    return "\n\n".join(table for table in each if table)


def rows_of(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Results by what is hidden, its size and the robots, from the whole to the parts; a set may be in several."""
    out: dict[str, list[Result]] = {}
    for result in sorted(results, key=lambda one: one["set"]["kind"]):
        kind, background = result["set"]["kind"], result["set"]["background"]
        least = min(result["set"]["factors"], default=np.nan)
        names = [kind, f"{kind}, {background}"]
        names += [f"{kind}, {words}" for low, high, words in SIZES if low <= least < high]
        if background == "uncalibrated" and result["set"]["names"]:
            names.append("uncalibrated with a fault")
        for name in names:
            out.setdefault(name, []).append(result)
    return out | {"all": list(results)}


def _line(name: str, own: Sequence[Result]) -> list[Any]:
    good = [score(result) for result in own if not result["error"]]
    hidden = sum(len(result.get("truth", {}).get("effects", ())) for result in own)
    laws = [law for one in good for law in one.laws]
    stated = [pair for one in good for pair in one.stated]
    left = [one.result["verdict"]["residual"]["chi2_per_n"] for one in good]
    return [
        name, len(own),
        f"{sum(one.right for one in good)} of {hidden}" if hidden else "-",
        f"{sum(bool(law['which'] and law['formula']) for law in laws)} of {len(laws)}" if laws else "-",
        _share(sum(one.whole for one in good), len(own)),
        sum(one.certain for one in good),
        f"{log_score(stated):.3f} ({len(stated)})" if stated else "-",
        f"{np.median(left):.2f}" if left else "-",
        median_and_most(result["cpu_s"] for result in own),
        median_and_most((result["peak_gb"] for result in own), 2),
        len(own) - len(good),
    ]  # fmt: skip


NAMES = (
    "hidden",
    "sets",
    "told",
    "named instead",
    "besides",
    "error median, worst [%]",
    "rms of error over se",
)


def _by_name(scored: Sequence[Scored]) -> list[list[Any]]:
    groups: dict[str, list[tuple[Scored, Score]]] = {}
    for one in scored:
        for each in one.scores:
            groups.setdefault(each.effect["cause"], []).append((one, each))
    rows = []
    for name, own in sorted(groups.items()):
        off = [100.0 * each.error for _, each in own if each.error is not None]
        z = [value for _, each in own for value in each.deviations]
        rows.append([
            name, len(own),
            sum(each.right for _, each in own),
            _counts(each.named for _, each in own if each.named and not each.right),
            _counts(item["cause"] for one, _ in own for item in (*one.extras, *one.strangers)),
            median_and_most(off),
            f"{np.sqrt(np.mean(np.square(z))):.1f} ({len(z)})" if z else "-",
        ])  # fmt: skip
    return rows


def _failures(results: Iterable[Result]) -> Counter[str]:
    return Counter(result["error"].splitlines()[-1] for result in results if result["error"])


def misses(results: Iterable[Result]) -> str:
    """Every set that is not wholly right, in a line: what was hidden, what was named."""
    lines = []
    for result in results:
        if result["error"]:
            lines.append(f"{result['key']}: {result['error'].splitlines()[-1]}")
            continue
        one = score(result)
        if not one.whole:
            hidden = "; ".join(_hidden(each) for each in one.scores) or "nothing"
            named = "; ".join(_named(item) for item in result["verdict"]["causes"]) or "nothing"
            left = result["verdict"]["residual"]["chi2_per_n"]
            lines.append(f"{result['key']}: hidden {hidden} | {one.verdict}: {named} | chi2/n {left:.2f}")
    return "\n".join(lines)


def _named(item: Result) -> str:
    law = item.get("law") or {}
    words = [item["name"], law.get("formula", ""), f"{100 * (item['probability'] or 0.0):.0f} %"]
    return ", ".join(word for word in words if word)


def _hidden(one: Score) -> str:
    effect, answer = one.effect, one.effect["answer"]
    where = "/".join(str(effect[key]) for key in ("robot", "joint") if effect.get(key) is not None)
    said = f" = {answer['cause']}" if answer["cause"] != effect["cause"] else ""
    return f"{effect['cause']}{said} at {where or 'the payload'} x{one.factor:.3g}"


def _share(hits: int, of: int) -> str:
    low, high = interval(hits, of)
    return f"{hits} ({100 * low:.0f} .. {100 * high:.0f} %)"


def _counts(words: Iterable[str]) -> str:
    return ", ".join(f"{name} {n}" for name, n in sorted(Counter(words).items())) or "-"


def _markdown(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    if not rows:
        return ""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
