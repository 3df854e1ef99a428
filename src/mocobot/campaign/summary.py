"""What a campaign found, as plain values.

format, version    "mocobot-campaign", 1
sets               {clean, hidden, diagnosed, failed: [{key, error, unexpected}]}
limits             list of {background, cause, kind, places, seen, parameters: {name: {median, low, high}}}: detection
                   limits that the diagnosis states for clean sets, over teams and places; ``seen`` of ``places`` show
                   it at all. A push's by trial.
false_alarms       list of {background, sets, alarms: share, named: {cause: number}, verdicts: {verdict: number}}, of
                   clean sets
found              list of {background, factor, right, cause, family, missed, extras}: shares of sets with something
                   hidden, by size over the detection limit; right is cause and place
causes             list of {cause, kind, right, missed, error, over_se}: the same by cause; median error of the
                   parameters over the truth, and rms of the error over its standard error, or null
confusion          {hidden: [cause], named: [cause or "nothing"], counts}: rows hidden, columns named for it
reliability        ``campaign.shares.reliability``
records            list, one for each set that was diagnosed, of {key, background, team, cause, robot, joint, factor,
                   verdict, named, probability, right, extras, error}

A share is {hits, of, interval}: exact 95 % interval.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.team.causes import CAUSES
from mocobot.campaign.score import Matched, match
from mocobot.campaign.shares import reliability, share
from mocobot_report.campaign.words import FORMAT

VERSION = 1
NOTHING = "nothing"

Json = dict[str, Any]


def summarise(results: Sequence[Mapping[str, Any]], exclude: Sequence[str] = ()) -> Json:
    """The summary of results, with the keys above.

    Args:
        results: of sets, as ``campaign.run`` keeps them.
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
    """A cause in words, wherever it sits."""
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
