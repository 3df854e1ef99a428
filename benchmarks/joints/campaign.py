"""Hide causes in robots, diagnose their logs with the engine of evidence, score.

    python benchmarks/joints/campaign.py --part panda|shapes|clean-shapes --first SEED --draws N --out DIR
    python benchmarks/joints/campaign.py --part panda --kind unlisted|left-out: laws of no table, causes taken out of it
    python benchmarks/joints/campaign.py --part panda --noise 2e-4 0.3: coarse sensors
    python benchmarks/joints/campaign.py --out DIR --tables

It goes on where it was stopped. Seconds are of CPU.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import tyro

from discrepancy.evidence.probability import odds_of, without_unfounded
from discrepancy.evidence.settings import SETTINGS
from discrepancy.joints.diagnose import diagnose
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import Given
from joints import arm as machine
from joints.foreign import make
from joints.sets import ArmSet, Kind
from joints.sets import make as make_arm
from mocobot_logs.joints.joint_log import JointLog
from scoring import SURE, log_score, median_and_most

RUBS = ("friction", "stribeck", "sublinear_friction", "asymmetric_coulomb", "asymmetric_viscous", "warming",
        "load_friction", "quadratic_drag")  # fmt: skip
ALIKE = (("torque_offset", "asymmetric_coulomb"), ("spring", "counterbalance", "ripple"), RUBS)
"""Names of one thing at one joint: no log without rests parts the first, terms of one friction are the last."""
Item = dict[str, Any]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: of the campaign.
        kind: of all sets of the panda; in turn where it is not given.
        factor: size of the panda's effects over their limits.
        noise: of the panda's positions [rad] and torques [N m] in place of its own.
        first: seed of the first set.
        draws: how many sets.
        out: where results go.
        tables: print the tables of the results instead.
    """

    part: Literal["panda", "shapes", "clean-shapes"] = "panda"
    kind: Kind | None = None
    factor: float = 4.0
    noise: tuple[float, float] | None = None
    first: int = 0
    draws: int = 10
    out: Path = Path("out/joints")
    tables: bool = False


def main(options: Options) -> None:
    """Run, or print."""
    path = options.out / "results.jsonl"
    results = [json.loads(x) for x in path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    if options.tables:
        print(tables(results))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    done = {(r["part"], r["seed"]) for r in results}
    for seed in range(options.first, options.first + options.draws):
        if (options.part, seed) in done:
            continue
        made = _arm(options, seed) if options.part == "panda" else make(options.part, seed, options.out)
        result = {"part": options.part, "seed": seed, "truth": made[2], "error": None}
        begun = time.process_time()
        try:
            result |= _found(*made)
        except Exception:  # one that fails must not end the campaign
            result["error"] = traceback.format_exc()
        result["cpu_s"] = time.process_time() - begun
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(result) + "\n")
        print("\n".join(told_of(result)), flush=True)


def _arm(options: Options, seed: int) -> tuple[SerialModel, list[JointLog], Item]:
    request = replace(ArmSet.of(seed, options.kind, options.factor), noise=options.noise)
    made, model = make_arm(request, options.out), machine.nominal(options.out)
    places = {"payload": model.bodies[-1], "push": "last link", "gravity_direction": "base"}
    faults = [e | {"place": places.get(e["cause"], f"joint{e['joint']}")} for e in made.truth["effects"]]
    if request.kind in ("unlisted", "left-out"):
        faults = [f | {"law": f["cause"] or f["name"], "cause": "unlisted"} for f in faults]
    truth = {"kind": request.kind, "faults": faults, "excluded": list(request.excluded)}
    return model, [made.log], truth


def _found(model: SerialModel, logs: list[JointLog], truth: Item) -> Item:
    """Causes with all that is told of them, the search's steps, and what further causes would gain."""
    steps: list[str] = []
    given = Given(excluded=frozenset(truth.get("excluded", ())))
    outcome = diagnose(model, logs, SETTINGS, say=lambda line: steps.append(str(line)), given=given)
    state, causes = without_unfounded(outcome.search, outcome.state), []
    for o in odds_of(outcome.search, state):
        rivals = [(r.group.key if r.group else ("nothing", ""), r.probability) for r in o.rivals]
        every = sorted([(o.chosen.group.key, o.probability), *rivals], key=lambda r: -r[1])
        told = [None if g is None else g.key for g in o.told()]
        causes.append({"name": o.chosen.group.name, "nats": o.over_nothing, "every": every[:6], "told": told})
    outcome = replace(outcome, state=state)
    hidden = {f["cause"] for f in truth["faults"]}
    offers = enumerate(outcome.search.offers(outcome.state))
    listed = [[round(g, 1), c.group.name] for k, (g, c) in offers if k < 3 or c.group.cause in hidden]
    return {"causes": causes, "steps": steps, "offers": listed[:12]}


def _same(fault: Item, key: Sequence[str]) -> bool:
    """Whether a cause at a place is the fault, or what no log parts from it; of a law of no table, from its law."""
    law = fault.get("law", fault["cause"])
    names = {n for family in ALIKE if law in family for n in family} | {fault["cause"]}
    return key[0] in names and (fault["cause"] == "push" or key[1] == fault["place"])


def score(result: Item) -> Item:
    """Which faults are named, and what is besides; a cause whose likeliest reading is open or nothing is not named."""
    truth, faults = result["truth"], result["truth"]["faults"]
    named = [c for c in result["causes"] if c["every"][0][0][1]]
    head = [c["every"][0][0] for c in named]
    hits, right = [], {k for k, h in enumerate(head) if truth.get("foreign") and h[0] in RUBS}
    for fault in faults:
        told = [[head[k], *([] if None in c["told"] else c["told"])] for k, c in enumerate(named)]
        own = {k for k, keys in enumerate(told) if any(_same(fault, key) for key in keys)}
        hit = bool(own)
        if fault["place"] == "all joints" and not own:
            own = {k for k, h in enumerate(head) if h[0] == fault["cause"]}
            hit = len(own) == truth["joints"]
        hits.append(hit)
        right |= own
    strangers = [c for k, c in enumerate(named) if k not in right]
    sure = [c for c in strangers if c["every"][0][1] >= SURE]
    missed = [f for f, hit in zip(faults, hits, strict=True) if not hit]
    stated = [(c["every"][0][1], k in right) for k, c in enumerate(named)]
    return {"hits": hits, "missed": missed, "certain": sure, "false": [c for c in strangers if c not in sure],
            "right": not missed and not strangers, "stated": stated}  # fmt: skip


def told_of(result: Item) -> list[str]:
    """A set in words."""
    truth = result["truth"]
    said = {k: v for k, v in truth.items() if k != "faults"}
    words = ("cause", "place", "name", "size")
    hidden = [" ".join(str(f[k]) for k in words if k in f) for f in truth["faults"]]
    begin = f"{result['part']} {result['seed']} {said}: {'; '.join(hidden)}"
    if result["error"]:
        return [begin, "    " + result["error"].splitlines()[-1]]
    s = score(result)
    out = [f"{begin} -> {'RIGHT' if s['right'] else 'not right'}, {result['cpu_s']:.1f} s"]
    for c in result["causes"]:
        mark = "CERTAIN" if c in s["certain"] else "false" if c in s["false"] else ""
        every = ", ".join(f"{' '.join(key)} {p:.2f}" for key, p in c["every"] if p > 0.02)
        out.append(f"    {mark:8s}{c['name']}, {c['nats']:.0f} nats: {every}")
    return out + [f"    missed  {f['cause']} {f['place']}; offers {result['offers']}" for f in s["missed"]]


def tables(results: Sequence[Item]) -> str:
    """All tables there are results for, as Markdown, and every set that is not right."""
    rows: dict[str, list[Item]] = {}
    for r in results:
        rows.setdefault(f"{r['part']} {r['truth'].get('kind', '')}", []).append(r)
    head = "| sets | falsely certain | false below 0.9 | faults named | wholly right | log score | errors | CPU s |"
    out = [head, "|---|---|---|---|---|---|---|---|"]
    for name, own in sorted(rows.items()):
        good = [score(r) for r in own if not r["error"]]
        certain, false, hits = (sum(len(s[what]) for s in good) for what in ("certain", "false", "hits"))
        named, right, bad = (
            sum(sum(s["hits"]) for s in good),
            sum(s["right"] for s in good),
            len(own) - len(good),
        )
        seconds, told = (
            median_and_most(r["cpu_s"] for r in own),
            log_score([x for s in good for x in s["stated"]]),
        )
        row = f"{certain} | {false} | {named} of {hits} | {right} | {told:.3f} | {bad} | {seconds}"
        out.append(f"| {name} ({len(own)}) | {row} |")
    wrong = [line for r in results if r["error"] or not score(r)["right"] for line in told_of(r)]
    return "\n".join([*out, "", *wrong])


if __name__ == "__main__":
    main(tyro.cli(Options))
