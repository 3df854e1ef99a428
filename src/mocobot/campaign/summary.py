"""Summarise the results of a campaign as plain values, text and a table.

format, version    "mocobot-campaign", 1
sets               {clean, hidden, diagnosed, failed: [{key, error, unexpected}]}
limits             list of {background, cause, kind, places, seen, parameters: {name: {median, low, high}}}: detection
                   limits in clean sets over teams and places (trials, for a push); the recordings can show the cause
                   at ``seen`` of ``places``
false_alarms       list of {background, sets, alarms: share, named: {cause: number}, verdicts: {verdict: number}} of
                   clean sets
found              list of {background, factor, right, cause, family, missed, extras}: shares of sets with a hidden
                   effect, by size over the detection limit; right means cause and place
causes             list of {cause, kind, right, missed, error, over_se}: the same shares by cause; error is the median
                   relative error of the parameters, over_se the rms of error over standard error, or null
confusion          {hidden: [cause], named: [cause or "nothing"], counts}: hidden causes in rows, named ones in columns
reliability        return value of ``reliability``
records            list of {key, background, team, cause, robot, joint, factor, verdict, named, probability, right,
                   extras, error}, one for each diagnosed set

A share is {hits, of, interval} with the exact 95 % interval.
"""

import csv
import io
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import beta

from discrepancy.team.causes import CAUSES
from mocobot.campaign.effects import one_axis
from mocobot_report import CAMPAIGN_FORMAT as FORMAT
from mocobot_report.campaign import sentences, tables
from mocobot_sim.effects.catalogue import EFFECTS

Json = dict[str, Any]
BINS = ((0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 0.99), (0.99, 1.0 + 1e-12))
"""Bins of stated probabilities: lower limit included, upper limit excluded. Chosen."""


def interval(hits: int, of: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return float(low), float(high)


def share(hits: int, of: int) -> dict[str, Any]:
    """Return counts and interval of a share as plain values: {hits, of, interval}."""
    return {"hits": hits, "of": of, "interval": list(interval(hits, of))}


def reliability(stated: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """Compare stated probabilities with the share of right answers.

    Args:
        stated: probability of every named cause, and whether the cause was right.

    Returns:
        {number, right, brier, bins: [{low, high, mean, right}]}, without empty bins. ``brier`` is the Brier score
        (Brier, Monthly Weather Review 78, 1950), 0 at best, None if nothing was named.
    """
    bins = []
    for low, high in BINS:
        own = [pair for pair in stated if low <= pair[0] < high]
        if own:
            mean = float(np.mean([p for p, _ in own]))
            bins.append(
                {
                    "low": low,
                    "high": min(high, 1.0),
                    "mean": mean,
                    "right": share(sum(ok for _, ok in own), len(own)),
                }
            )
    return {
        "number": len(stated),
        "right": sum(ok for _, ok in stated),
        "brier": float(np.mean([(p - ok) ** 2 for p, ok in stated])) if stated else None,
        "bins": bins,
    }


Item = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """How well a diagnosis found one hidden effect.

    Attributes:
        effect: hidden effect from the truth.
        factor: size of the effect over its detection limit.
        listed: whether the diagnosis could have named the right cause.
        named: cause that the verdict names for the effect, or None.
        family, member: whether the family of the cause is right, and whether the cause itself is.
        ambiguous: the named cause is wrong, but the verdict lists the right one at its place as an ambiguous rival.
        place: whether the place is right.
        error: largest relative error of the parameters that the truth states; None without any.
        deviations: error over standard error of each parameter.
    """

    effect: Item
    factor: float
    listed: bool
    named: str | None
    family: bool
    member: bool
    ambiguous: bool
    place: bool
    error: float | None
    deviations: tuple[float, ...]

    @property
    def right(self) -> bool:
        """Whether cause and place are right."""
        return self.place and (self.member or self.ambiguous)


@dataclass(frozen=True)
class Matched:
    """Named causes of a verdict, matched to the hidden effects.

    Attributes:
        scores: one score per hidden effect.
        extras: named causes without a hidden effect.
        stated: probability of every cause named with one, and whether the cause was right.
    """

    scores: tuple[Score, ...]
    extras: tuple[Item, ...]
    stated: tuple[tuple[float, bool], ...]


def match(
    named: Sequence[Item],
    truth: Item,
    factors: Sequence[float],
    listed: Callable[[str | None], bool] = lambda cause: cause in CAUSES,
) -> Matched:
    """Score the causes of a diagnosis against the hidden effects.

    Args:
        named: ``causes`` of the diagnosis, as ``discrepancy.result.json`` documents them.
        truth: ``effects``, each with its right ``answer`` {cause, robot, joint, known: {parameter: value}}, and
            ``gimbal_axes_1`` (``effects.gimbal_axes``).
        factors: size of every effect over its detection limit.
        listed: tells whether the diagnosis could have named a cause.
    """
    left = list(named)
    scores, matched = [], []
    for effect, factor in zip(truth["effects"], factors, strict=True):
        known = listed(effect["answer"]["cause"])
        item = _match(left, effect, truth, alone=len(truth["effects"]) == 1) if known else None
        scores.append(_score(item, effect, factor, truth, listed=known))
        if item is not None:
            left.remove(item)
            matched.append((item, scores[-1].right))
    stated = [*matched, *((item, False) for item in left)]
    return Matched(
        tuple(scores),
        tuple(left),
        tuple((float(i["probability"]), right) for i, right in stated if i.get("probability") is not None),
    )


def _match(found: Sequence[Item], effect: Item, truth: Item, *, alone: bool) -> Item | None:
    """Return the named cause that fits a hidden effect best: by cause and place, else cause, else family.

    With a single hidden effect (``alone``), any named cause counts as an answer to it.
    """

    def rank(item: Item) -> tuple[bool, bool, bool]:
        member = item["cause"] == effect["answer"]["cause"]
        return member and _same_place(item, effect, truth), member, item["family"] == family_of(effect)

    if not found:
        return None
    best = max(found, key=rank)
    return best if any(rank(best)) or alone else None  # an unrelated cause belongs to none of several


def family_of(effect: Item) -> str | None:
    """Family of the right cause; None if the catalogue lacks it."""
    cause = CAUSES.get(effect["answer"]["cause"])
    return None if cause is None else cause.family


def _score(item: Item | None, effect: Item, factor: float, truth: Item, *, listed: bool) -> Score:
    if item is None:
        return Score(effect, factor, listed, None, False, False, False, False, None, ())
    answer = effect["answer"]
    member = item["cause"] == answer["cause"]
    ambiguous = not member and any(
        rival["cause"] == answer["cause"] and _here(rival) == _here(answer)
        for rival in item.get("alternatives", ())
        if rival.get("ambiguous")
    )
    place = ambiguous or (member and _same_place(item, effect, truth))
    error, deviations = _errors(item, effect) if member and place else (None, ())
    family = item["family"] == family_of(effect)
    return Score(effect, factor, listed, item["cause"], family, member, ambiguous, place, error, deviations)


def _here(item: Item) -> tuple[int | None, int | None]:
    return item.get("robot"), item.get("joint")


def _same_place(item: Item, effect: Item, truth: Item) -> bool:
    answer = effect["answer"]
    if item["cause"] == answer["cause"] == "gimbal_friction":  # the data cannot distinguish parallel axes
        return one_axis(truth["gimbal_axes_1"], item, answer)
    if answer["cause"] == "push":
        p, q = {name: entry["value"] for name, entry in item["parameters"].items()}, effect["parameters"]
        both = min(p["start_s"] + p["duration_s"], q["start_s"] + q["duration_s"])
        return p["trial"] == q["trial"] and both > max(p["start_s"], q["start_s"])
    if item["cause"] == answer["cause"] == "payload_mass":  # the same kind of change in the same trials
        p, known = {name: entry["value"] for name, entry in item["parameters"].items()}, answer["known"]
        alike = bool(p["rate_kgps"]) == bool(known.get("rate_kgps"))
        return alike and all(p[name] == known[name] for name in ("trial", "last_trial") if name in known)
    return _here(item) == _here(answer)


def _errors(item: Item, effect: Item) -> tuple[float | None, tuple[float, ...]]:
    """Compute the errors of the parameters that the data determine.

    For a push these exclude its point, start and duration.

    Returns:
        Largest relative error, or None, and the errors over their standard errors.
    """
    known, named = effect["answer"]["known"], item["parameters"]
    cause = effect["answer"]["cause"]
    skipped = (
        ("point", "start", "duration", "trial") if cause == "push" else ("trial", "last_trial", "inertia")
    )
    least = EFFECTS[cause].inherent if cause in EFFECTS else {}
    names = [name for name in named if name in known and not name.startswith(skipped)]
    names = [name for name in names if abs(known[name]) >= least.get(name, 0.0)]
    names = [name for name in names if named[name]["value"] or name not in least]
    if not names:
        return None, ()
    away = np.array([named[name]["value"] - known[name] for name in names])
    size = np.array([known[name] for name in names])
    se = [named[name]["se"] for name in names]
    deviations = tuple(float(d / s) for d, s in zip(away, se, strict=True) if s)
    units = np.abs(size) > 0.1 * np.abs(size).max() if len(names) > 1 and _alike(names) else size != 0
    if cause == "payload_mass":  # only the mass defines the size
        units &= [name in ("mass_kg", "rate_kgps") for name in names]
    error = float(np.max(np.abs(away[units] / size[units]))) if units.any() else None
    return error, deviations


def _alike(names: Sequence[str]) -> bool:
    """Whether all parameters have the same unit, so that errors of small ones can be ignored beside large ones."""
    return len({name.rsplit("_", 1)[-1] for name in names}) == 1


VERSION = 1
NOTHING = "nothing"


def summarise(results: Sequence[Mapping[str, Any]], exclude: Sequence[str] = ()) -> Json:
    """Summarise the results of all sets; the docstring of this module documents the keys.

    Args:
        results: results of the sets, as ``campaign.run`` stores them.
        exclude: causes that the diagnosis did not consider.
    """
    sound = [r for r in results if r["error"] is None]
    clean = [r for r in sound if r["set"]["cause"] is None]
    hidden = [r for r in sound if r["set"]["cause"] is not None]
    matched = {r["set"]["key"]: _matched(r, exclude) for r in sound}
    stated = [pair for one in matched.values() for pair in one.stated]
    return {
        "format": FORMAT,
        "version": VERSION,
        "sets": {
            "clean": sum(r["set"]["cause"] is None for r in results),
            "hidden": sum(r["set"]["cause"] is not None for r in results),
            "diagnosed": len(sound),
            "failed": [
                {"key": r["set"]["key"], "error": r["error"], "unexpected": r["unexpected"]}
                for r in results
                if r["error"] is not None
            ],
        },
        "limits": _limits(clean),
        "false_alarms": [_alarms(b, own) for b, own in _by(clean, "background").items()],
        "found": [
            {"background": background, **_found(factor, own, matched)}
            for background, sets in _by(hidden, "background").items()
            for factor, own in sorted(_by(sets, "factor").items())
        ],
        "causes": _causes(hidden, matched),
        "confusion": _confusion(hidden, matched),
        "reliability": reliability(stated),
        "records": [_record(r, matched[r["set"]["key"]]) for r in sound],
    }


def _matched(result: Mapping[str, Any], exclude: Sequence[str]) -> Matched:
    factor = result["set"]["factor"]
    factors = [factor] * len(result["truth"]["effects"])
    return match(
        result["verdict"]["causes"],
        result["truth"],
        factors,
        lambda cause: cause in CAUSES and cause not in exclude,
    )


def _by(results: Sequence[Mapping[str, Any]], key: str) -> dict[Any, list[Mapping[str, Any]]]:
    out: dict[Any, list[Mapping[str, Any]]] = {}
    for result in results:
        out.setdefault(result["set"][key], []).append(result)
    return out


def _limits(clean: Sequence[Mapping[str, Any]]) -> list[Json]:
    out = []
    for background, sets in _by(clean, "background").items():
        entries: dict[str, list[Mapping[str, Any]]] = {}
        for result in sets:
            for entry in result["limits"]["places"]:
                entries.setdefault(entry["cause"], []).append(entry["parameters"])
            for entry in result["limits"]["pushes"]:
                entries.setdefault("push", []).append(entry["parameters"])
        for cause in (cause for cause in CAUSES if cause in entries):
            own = entries[cause]
            values = {name: [entry[name] for entry in own if entry.get(name) is not None] for name in own[0]}
            out.append(
                {
                    "background": background,
                    "cause": cause,
                    "kind": kind_of(cause),
                    "places": len(own),
                    "seen": sum(any(size is not None for size in entry.values()) for entry in own),
                    "parameters": {
                        name: {
                            "median": float(np.median(sizes)),
                            "low": float(min(sizes)),
                            "high": float(max(sizes)),
                        }
                        for name, sizes in values.items()
                        if sizes
                    },
                }
            )
    return out


def kind_of(cause: str) -> str:
    """Return the title of a cause in words, without a specific place."""
    return CAUSES[cause].title.replace("{", "a ").replace("}", "")


def _alarms(background: str, sets: Sequence[Mapping[str, Any]]) -> Json:
    named = Counter(item["cause"] for r in sets for item in r["verdict"]["causes"])
    return {
        "background": background,
        "sets": len(sets),
        "alarms": share(sum(bool(r["verdict"]["causes"]) for r in sets), len(sets)),
        "named": dict(named),
        "verdicts": dict(Counter(r["verdict"]["verdict"] for r in sets)),
    }


def _found(factor: float, sets: Sequence[Mapping[str, Any]], matched: Mapping[str, Matched]) -> Json:
    ones = [matched[r["set"]["key"]] for r in sets]
    scores = [one.scores[0] for one in ones]
    return {
        "factor": factor,
        "right": share(sum(s.right for s in scores), len(scores)),
        "cause": share(sum(s.member or s.ambiguous for s in scores), len(scores)),
        "family": share(sum(s.family or s.ambiguous for s in scores), len(scores)),
        "missed": share(sum(s.named is None for s in scores), len(scores)),
        "extras": share(sum(bool(one.extras) for one in ones), len(ones)),
    }


def _causes(hidden: Sequence[Mapping[str, Any]], matched: Mapping[str, Matched]) -> list[Json]:
    by_cause = _by(hidden, "cause")
    out = []
    for cause in (cause for cause in CAUSES if cause in by_cause):
        scores = [matched[r["set"]["key"]].scores[0] for r in by_cause[cause]]
        errors = [s.error for s in scores if s.error is not None]
        deviations = [z for s in scores for z in s.deviations]
        out.append(
            {
                "cause": cause,
                "kind": kind_of(cause),
                "right": share(sum(s.right for s in scores), len(scores)),
                "missed": share(sum(s.named is None for s in scores), len(scores)),
                "error": float(np.median(errors)) if errors else None,
                "over_se": float(np.sqrt(np.mean(np.square(deviations)))) if deviations else None,
            }
        )
    return out


def _confusion(hidden: Sequence[Mapping[str, Any]], matched: Mapping[str, Matched]) -> Json:
    pairs = Counter((r["set"]["cause"], matched[r["set"]["key"]].scores[0].named or NOTHING) for r in hidden)
    rows = [cause for cause in CAUSES if any(pair[0] == cause for pair in pairs)]
    columns = [name for name in (*CAUSES, NOTHING) if name in rows or any(pair[1] == name for pair in pairs)]
    return {
        "hidden": rows,
        "named": columns,
        "counts": [[pairs[row, column] for column in columns] for row in rows],
    }


def _record(result: Mapping[str, Any], one: Matched) -> Json:
    told = result["set"]
    score = one.scores[0] if one.scores else None
    effect = score.effect if score else {}
    said = [item for item in result["verdict"]["causes"] if item not in one.extras]
    return {
        "key": told["key"],
        "background": told["background"],
        "team": told["team"],
        "cause": told["cause"],
        "robot": effect.get("robot"),
        "joint": effect.get("joint"),
        "factor": told["factor"],
        "verdict": result["verdict"]["verdict"],
        "named": score.named if score else None,
        "probability": said[0]["probability"] if said else None,
        "right": score.right if score else not one.extras,
        "extras": [item["cause"] for item in one.extras],
        "error": score.error if score else None,
    }


WIDTH = 110
COLUMNS = (
    "key", "background", "team", "cause", "robot", "joint", "factor", "verdict", "named", "probability", "right",
    "extras", "error",
)  # fmt: skip


def format_campaign(summary: Item) -> str:
    """Return the text report."""
    head, *more = sentences(summary)
    parts = [
        "\n".join([*_fill(head), *(line for sentence in more for line in _fill(sentence, "- "))]),
        *(f"{title}\n\n{_aligned(heads, rows)}" for title, heads, rows in tables(summary)),
        _failed(summary["sets"]["failed"]),
    ]
    return "\n\n".join(part for part in parts if part)


def csv_table(summary: Item) -> str:
    """Return CSV with the columns ``COLUMNS`` and one line per diagnosed set; unknown values are empty."""
    out = io.StringIO()
    writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for record in summary["records"]:
        writer.writerow(record | {"extras": " ".join(record["extras"])})
    return out.getvalue()


def _failed(failed: Sequence[Item]) -> str:
    lines = [
        line
        for entry in failed
        for line in _fill(f"{entry['key']}: {entry['error'].strip().splitlines()[-1]}", "- ")
    ]
    return "\n".join([f"Not diagnosed: {len(failed)}", "", *lines]) if lines else ""


def _fill(sentence: str, mark: str = "") -> list[str]:
    held = sentence.replace(" %", "\0%")  # keep a number and its percent sign on one line
    lines = textwrap.wrap(held, WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
    return [line.replace("\0", " ") for line in lines]


def _aligned(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [heads, *rows]
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
