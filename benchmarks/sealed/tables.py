"""Results as Markdown tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from discrepancy.team.estimates import errors
from mocobot.campaign.summary import interval, reliability
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth
from scoring import log_score, median_and_most
from sealed.score import Score, Scored, score

SIZES = ((0.0, 3.0, "below 3 limits"), (3.0, np.inf, "3 limits and more"))
ESTIMATES = {
    "mass_percent": "mass [%]",
    "com_mm": "centre of mass [mm]",
    "principal_inertia_percent": "inertia [%]",
}
HEAD = (
    "row", "sets", "hidden effects told", "and with formula", "sets wholly right", "falsely certain", "log score",
    "chi2/n left", "CPU median, most [s]", "memory median, most [GB]", "errors",
)  # fmt: skip
Result = Mapping[str, Any]


def tables(results: Iterable[Result]) -> str:
    """All tables there are results for."""
    results = list(results)
    scored = [score(result) for result in results if not result["error"]]
    stated = [pair for one in scored for pair in one.stated]
    each = [
        _markdown("Rows", HEAD, [_line(name, own) for name, own in rows_of(results).items()]),
        _markdown("Effects by name", NAMES, _by_name(scored)),
        _reliability(stated),
        _markdown("What the verdict is worth: median before -> after, sets in which it falls", WORTH, _worth(scored)),
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
            sum(each.right if each.listed else one.whole for one, each in own),
            _counts(each.named for _, each in own if each.named and not each.right),
            _counts(item["cause"] for one, _ in own for item in (*one.extras, *one.strangers)),
            median_and_most(off),
            f"{np.sqrt(np.mean(np.square(z))):.1f} ({len(z)})" if z else "-",
        ])  # fmt: skip
    return rows


def _reliability(stated: Sequence[tuple[float, bool]]) -> str:
    found = reliability(stated)
    rows = [
        [f"{100 * b['low']:.0f} to {100 * b['high']:.0f} %", b["right"]["of"], f"{100 * b['mean']:.1f} %",
         _share(b["right"]["hits"], b["right"]["of"])]
        for b in found["bins"]
    ]  # fmt: skip
    return _markdown("Stated probabilities", ("stated", "causes", "mean of it", "right"), rows)


WORTH = ("row", "sets", "response chi2/n", "of its excess removed", *ESTIMATES.values())


def _worth(scored: Sequence[Scored]) -> list[list[Any]]:
    rows = []
    by_kind = rows_of([one.result for one in scored])
    for kind in sorted({one.result["set"]["kind"] for one in scored}):
        gains = [
            (r["verdict"]["gain"], r["set"]["payload"]) for r in by_kind.get(kind, ()) if r["verdict"]["gain"]
        ]
        held = [g["held_out"] for g, _ in gains if g["held_out"]["before"] and g["held_out"]["after"]]
        pairs = [[each[name]["chi2_per_n"] for name in ("before", "after")] for each in held]
        removed = [g["removed"]["share"] for g, _ in gains if g["removed"]]
        off = [
            [errors(g["estimates"][w], _truth(payload)) for w in ("before", "after")] for g, payload in gains
        ]
        if gains:
            rows.append([
                kind, len(gains), _before_after(pairs), f"{np.median(removed):.0%}" if removed else "-",
                *(_before_after([[e[name] for e in pair] for pair in off]) for name in ESTIMATES),
            ])  # fmt: skip
    return rows


@cache
def _truth(payload: str) -> dict[str, Any]:
    return GroundTruth.of(build_team(payload)).to_dict()


def _before_after(pairs: Sequence[Sequence[float]]) -> str:
    if not pairs:
        return "-"
    before, after = np.transpose(pairs)
    return f"{np.median(before):.2g} -> {np.median(after):.2g}, {int(np.sum(after < before))}"


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
