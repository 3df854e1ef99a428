"""Hide causes in robots, diagnose their logs with the engine of evidence, score.

    python benchmarks/joints/campaign.py --part panda|bare|shapes|clean-shapes --first SEED --draws N --out DIR
    python benchmarks/joints/campaign.py --out DIR --tables

It goes on where it was stopped. Seconds are of CPU.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import tyro

from arm import machine
from arm.sets import ArmSet
from arm.sets import make as make_arm
from discrepancy.evidence.odds import odds_of
from discrepancy.joints.diagnose import diagnose, labels_of
from discrepancy.serial.model import SerialModel
from discrepancy.serial.recording.joint_log import JointLog
from joints.foreign import make, thinned

RATES_HZ = (1000.0, 250.0, 50.0)
KINDS = ("clean", "single", "clean", "single", "pairs")
"""Of successive sets of the panda."""
RUBS = ("friction", "stribeck", "sublinear_friction", "asymmetric_coulomb", "asymmetric_viscous", "warming", "load_friction")
ALIKE = (("torque_offset", "asymmetric_coulomb"), ("spring", "counterbalance", "ripple"), RUBS)
"""Names of one thing at one joint: no log without rests parts the first, terms of one friction are the last."""
SURE = 0.9
Item = dict[str, Any]
Sets = Iterator[tuple[Item, SerialModel, list[JointLog], Item]]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: of the campaign.
        kind: of all sets of the panda; in turn where it is not given.
        first: seed of the first set.
        draws: how many sets.
        out: where results go.
        tables: print the tables of the results instead.
        misses: print every set that is not right instead.
    """

    part: Literal["panda", "bare", "shapes", "clean-shapes"] = "panda"
    kind: Literal["clean", "single", "pairs", "triples"] | None = None
    first: int = 0
    draws: int = 10
    out: Path = Path("out/joints")
    tables: bool = False
    misses: bool = False


def main(options: Options) -> None:
    """Run, or print."""
    path = options.out / "results.jsonl"
    results = [json.loads(x) for x in path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    if options.tables or options.misses:
        print(tables(results) if options.tables else "\n".join(misses(results)))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    done = {(r["part"], r["seed"], r["rate_hz"]) for r in results}
    for seed in range(options.first, options.first + options.draws):
        rates = RATES_HZ if options.part == "bare" else (500.0 if options.part == "panda" else 250.0,)
        left = [r for r in rates if (options.part, seed, r) not in done]
        if not left:
            continue
        model, logs, truth = _made(options, seed)
        for rate in left:
            result = {"part": options.part, "seed": seed, "rate_hz": rate, "truth": truth, "error": None}
            begun = time.process_time()
            try:
                result |= _found(model, [thinned(g, rate) for g in logs], truth)
            except Exception:  # one that fails must not end the campaign
                result["error"] = traceback.format_exc()
            result["cpu_s"] = time.process_time() - begun
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(result) + "\n")
            print("\n".join(told_of(result)), flush=True)


def _made(options: Options, seed: int) -> tuple[SerialModel, list[JointLog], Item]:
    if options.part != "panda":
        model, logs, truth = make(options.part, seed, options.out)
        return model, logs, {"faults": truth.faults, "values": truth.values, **truth.told}
    request = ArmSet.of(seed, options.kind or KINDS[seed % len(KINDS)], 4.0)  # type: ignore[arg-type]
    made = make_arm(request, options.out)
    model = machine.nominal(options.out)
    places = {"payload": model.bodies[-1], "push": "last link", "gravity_direction": "base"}
    faults = [
        {"cause": e["cause"], "form": e["name"], "size": e["size"], "place": places.get(e["cause"], f"joint{e['joint']}")}
        for e in made.truth["effects"]
    ]  # fmt: skip
    return model, [made.log], {"faults": faults, "values": {}, "kind": request.kind}


def _found(model: SerialModel, logs: list[JointLog], truth: Item) -> Item:
    """The verdict: every cause with what is told of it, values, and what the next ones would gain."""
    steps: list[str] = []
    outcome = diagnose(model, logs, say=lambda line: steps.append(str(line)))
    causes = []
    for o in odds_of(outcome.search, outcome.state, 1.0):
        own = {"cause": o.chosen.group.cause, "place": o.chosen.group.place, "probability": o.probability}
        rivals = [
            {"cause": r.group.cause if r.group else ("open" if r.open else "nothing"),
             "place": r.group.place if r.group else "", "probability": r.probability}
            for r in o.rivals[:6]
        ]  # fmt: skip
        told = [None if g is None else [g.cause, g.place] for g in o.told()]
        shape = dict(o.chosen.group.shape)
        causes.append(own | {"shape": shape, "nats": o.over_nothing, "rivals": rivals, "told": told})
    numbers = labels_of(outcome)
    offers = outcome.search.offers(outcome.state)
    hidden = {f["cause"] for f in truth["faults"]}
    listed = [[round(g, 1), c.group.name] for k, (g, c) in enumerate(offers) if k < 3 or c.group.cause in hidden][:12]
    z = {k: [numbers[k][0], numbers[k][1], v] for k, v in truth["values"].items() if k in numbers}
    sizes = {k: [round(v, 6), round(e, 6)] for k, (v, e) in numbers.items()}
    return {"causes": causes, "steps": steps, "offers": listed, "z": z, "sizes": sizes}


# --- scoring


def _same(fault: Item, key: Sequence[str] | None) -> bool:
    """Whether a cause at a place is the fault, or what no log parts from it."""
    if key is None:
        return False
    cause, place = key
    names = {n for family in ALIKE if fault["cause"] in family for n in family} | {fault["cause"]}
    return cause in names and (place == fault["place"] or (cause == "push" and place.startswith("last link")))


def score(result: Item) -> Item:
    """Hits by fault, and what was named besides; friction is none where the robot has it without its model's knowing."""
    truth, found = result["truth"], result["causes"]
    faults, named = truth["faults"], []
    for c in found:
        every = sorted([c, *c["rivals"]], key=lambda r: -r["probability"])
        if every[0]["cause"] in ("open", "nothing"):
            continue
        named.append((every[0], c))
    hits, right = [False] * len(faults), set()
    for i, fault in enumerate(faults):
        for k, (head, c) in enumerate(named):
            if _same(fault, (head["cause"], head["place"])) or (
                None not in c["told"] and any(_same(fault, t) for t in c["told"])
            ):
                hits[i] = True
                right.add(k)
        if fault["place"] == "all joints" and not hits[i]:
            own = [k for k, (head, _) in enumerate(named) if head["cause"] == fault["cause"]]
            right |= set(own)
            hits[i] = len(own) == truth.get("joints")
    strangers = [
        (head, c["nats"]) for k, (head, c) in enumerate(named)
        if k not in right and not (truth.get("foreign") and head["cause"] in RUBS)
    ]  # fmt: skip
    return {
        "hits": hits, "missed": [f for f, hit in zip(faults, hits, strict=True) if not hit],
        "certain": [s for s in strangers if s[0]["probability"] >= SURE],
        "false": [s for s in strangers if s[0]["probability"] < SURE],
        "right": all(hits) and not strangers,
    }  # fmt: skip


def told_of(result: Item) -> list[str]:
    """A set in words."""
    truth = result["truth"]
    said = {k: v for k, v in truth.items() if k not in ("faults", "values")}
    hidden = [f"{f['cause']} at {f['place']}" + (f" ({f['size']:.3g})" if "size" in f else "") for f in truth["faults"]]
    out = [f"{result['part']} {result['seed']} {result['rate_hz']:.0f} Hz {said}: {'; '.join(hidden)}"]
    if result["error"]:
        return [*out, "    " + result["error"].splitlines()[-1]]
    scored = score(result)
    out[0] += f" -> {'RIGHT' if scored['right'] else 'not right'}, {result['cpu_s']:.1f} s"
    for c in result["causes"]:
        rivals = ", ".join(f"{r['cause']} {r['place']} {r['probability']:.2f}" for r in c["rivals"] if r["probability"] > 0.03)
        mark = next((m for m in ("certain", "false") for s, _ in scored[m] if s is c or s in c["rivals"]), "")
        out.append(f"    {mark:8s}{c['cause']} at {c['place']} {c['shape'] or ''} p {c['probability']:.2f}, {c['nats']:.0f} nats; {rivals}")
    if scored["missed"]:
        out += [f"    missed  {f['cause']} at {f['place']}" for f in scored["missed"]] + [f"    offers  {result['offers']}"]
    return out


def misses(results: Sequence[Item]) -> list[str]:
    """Every set that is not right."""
    return [line for r in results if r["error"] or not score(r)["right"] for line in told_of(r)]


def tables(results: Sequence[Item]) -> str:
    """All tables there are results for, as Markdown."""
    rows: dict[str, list[Item]] = {}
    for r in results:
        by = f" {r['truth']['kind']}" if r["part"] == "panda" else f" {r['rate_hz']:.0f} Hz" if r["part"] == "bare" else ""
        rows.setdefault(r["part"] + by, []).append(r)
    out = ["| sets | falsely certain | false below 0.9 | faults named | missed | wholly right | errors | CPU s median, most |",
           "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for name, own in sorted(rows.items()):
        good = [score(r) for r in own if not r["error"]]
        of = lambda what: sum(len(s[what]) for s in good)  # noqa: E731
        cpu = [r["cpu_s"] for r in own]
        out.append(
            f"| {name} ({len(own)}) | {of('certain')} | {of('false')} | {sum(sum(s['hits']) for s in good)} of {of('hits')} "
            f"| {of('missed')} | {sum(s['right'] for s in good)} of {len(own)} | {len(own) - len(good)} "
            f"| {np.median(cpu):.1f}, {max(cpu):.1f} |"
        )
    out += ["", *_calibration(results), *_rates(results)]
    return "\n".join(out)


def _calibration(results: Sequence[Item]) -> list[str]:
    """Of values of bare robots: root mean square of error over standard error, and the median standard error's share."""
    kinds: dict[tuple[str, float], list[list[float]]] = {}
    for r in results:
        if r["part"] == "bare" and not r["error"]:
            for label, numbers in r["z"].items():
                word = " ".join(label.split()[1:]) if label.startswith("joint") else f"payload {label.split()[-1]}"
                kinds.setdefault((word, r["rate_hz"]), []).append(numbers)
    if not kinds:
        return []
    out = ["| value | Hz | n | rms of error over se | median of se over size |", "|---|---|---|---|---|"]
    for (word, rate), own in sorted(kinds.items()):
        value, se, true = np.array(own).T
        z = np.sqrt(np.mean(((value - true) / se) ** 2))
        out.append(f"| {word} | {rate:.0f} | {len(own)} | {z:.2f} | {np.median(se / np.abs(true)):.3f} |")
    return [*out, ""]


def _rates(results: Sequence[Item]) -> list[str]:
    """How many bare robots have one verdict at all rates."""
    sets: dict[int, list[list[str]]] = {}
    for r in results:
        if r["part"] == "bare" and not r["error"]:
            sets.setdefault(r["seed"], []).append(sorted(f"{c['cause']} {c['place']}" for c in r["causes"]))
    whole = [v for v in sets.values() if len(v) == len(RATES_HZ)]
    return [f"The same verdict at all rates: {sum(all(x == v[0] for x in v) for v in whole)} of {len(whole)}."] if whole else []


if __name__ == "__main__":
    main(tyro.cli(Options))
