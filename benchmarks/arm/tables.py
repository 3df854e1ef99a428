"""Results of the arm's campaign, held against their truth, as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from discrepancy.serial.causes import CAUSES

from mocobot.campaign.summary import interval, reliability

Item = Mapping[str, Any]
SILENT = ("consistent", "miscalibrated")
RUBS = (
    "friction", "stribeck", "sublinear_friction", "load_friction", "warming", "asymmetric_coulomb",
    "asymmetric_viscous",
)  # fmt: skip
"""Terms of one friction over speed, direction and load: a form of its own needs several."""


@dataclass(frozen=True)
class Scored:
    """One set.

    Attributes:
        result: of the campaign.
        hits: for every hidden effect: whether its cause and joint are named, or among what cannot be told from it.
        families: the same of its family.
        extras: what was named besides; terms of a friction that is there are not, nor the disc of a zero.
        stated: probability and rightness of every named cause.
    """

    result: Item
    hits: tuple[bool, ...]
    families: tuple[bool, ...]
    extras: tuple[Item, ...]
    stated: tuple[tuple[float, bool], ...]

    @property
    def silent(self) -> bool:
        """Nothing named, and nothing called unexplained."""
        return self.result["verdict"]["verdict"] in SILENT

    @property
    def whole(self) -> bool:
        """Everything found and nothing besides; of what nobody lists, nothing but laws."""
        if self.result["kind"] in ("clean",):
            return self.silent
        strangers = [e for e in self.extras if e["cause"] != "law"]
        if self.result["kind"] in ("unlisted", "left-out"):
            return not self.silent and not strangers
        return all(self.hits) and not self.extras


ALSO: Mapping[str, tuple[str, ...]] = {"grease": ("friction",), "one_way": ("torque_offset",)}
"""Causes that a form is as well: friction over the logarithm of the speed is hardly bent; what rubs forwards alone is
a constant while it moves."""


def score(result: Item) -> Scored:
    """Hold one result against its truth."""
    named = list(result["verdict"]["causes"])
    excluded = result["kind"] == "left-out"
    hits, families, right = [], [], []
    for effect in result["truth"]["effects"]:
        cause = None if excluded else effect["cause"]
        causes = [cause, *ALSO.get(effect["name"], ())] if cause else []
        here = [n for c in causes for n in named if _is(n, effect, c)]
        hits.append(bool(here))
        right += here[:1]
        family = CAUSES[effect["cause"]].family if effect["cause"] else None
        families.append(any(n["family"] == family for n in named))
    effects = [] if excluded else result["truth"]["effects"]
    rubbing = [e["joint"] for e in effects if e["cause"] in RUBS]
    right += [
        n for n in named if n["cause"] in RUBS and n["joint"] in rubbing and not any(n is r for r in right)
    ]
    extras = tuple(
        n for n in named if not any(n is r for r in right) and not any(_is_its_disc(n, e) for e in effects)
    )
    stated = [(float(n["probability"]), any(n is r for r in right)) for n in named if n["cause"] != "law"]
    return Scored(result, tuple(hits), tuple(families), extras, tuple(stated))


def _is(named: Item, effect: Item, cause: str) -> bool:
    """The cause at its joint, itself or as one that is said to be not told apart."""
    alike = [r for r in named.get("alternatives", ()) if r.get("ambiguous")]
    return any(
        n["cause"] == cause and (cause in ("payload", "push") or n.get("joint") == effect["joint"])
        for n in (named, *alike)
    )


def _is_its_disc(named: Item, effect: Item) -> bool:
    """A law that says what a hidden zero has besides: its disc is off its axis, by 15 % of the zero once a turn."""
    law = named.get("law") or {}
    return (
        effect["name"] == "zero"
        and named.get("joint") == effect["joint"]
        and (law.get("place"), law.get("function")) == ("joint position", "sine")
        and law["numbers"]["times"] == 1.0
    )


def tables(results: Sequence[Item]) -> str:
    """All tables there are results for."""
    scored = [score(r) for r in results if not r["error"]]
    out = []
    rows = []
    for kind in ("clean", "single", "pairs", "triples", "unlisted", "left-out"):
        own = [s for s in scored if s.result["kind"] == kind]
        if not own:
            continue
        effects = [h for s in own for h in s.hits]
        extras = Counter(e["cause"] for s in own for e in s.extras)
        silent = sum(s.silent for s in own)
        rows.append([
            kind, len(own), share(sum(s.whole for s in own), len(own)),
            share(sum(effects), len(effects)) if kind not in ("clean", "unlisted", "left-out") else "-",
            silent, sum(any(e["cause"] != "law" for e in s.extras) for s in own), counts(extras),
        ])  # fmt: skip
    header = [
        "sets",
        "number",
        "wholly right",
        "effects found",
        "silent",
        "sets with a wrong cause",
        "named wrongly",
    ]
    out.append(markdown("Sets", header, rows))
    rows = []
    for low, high, title in ((0, 1.5, "below 1.5"), (1.5, 3, "2"), (3, 5.5, "4"), (5.5, np.inf, "8")):
        each = [(h, f) for s in scored if s.result["kind"] in ("single", "pairs", "triples")
                for h, f, e in zip(s.hits, s.families, s.result["truth"]["effects"], strict=True)
                if low <= e["factor"] < high]  # fmt: skip
        if each:
            rows.append(
                [
                    title,
                    len(each),
                    share(sum(h for h, _ in each), len(each)),
                    share(sum(f for _, f in each), len(each)),
                ]
            )
    out.append(markdown("By size", ["over the limit", "effects", "cause and joint", "family"], rows))
    rows = []
    every = [(e, h) for s in scored if s.result["kind"] in ("single", "pairs", "triples")
             for e, h in zip(s.result["truth"]["effects"], s.hits, strict=True)]  # fmt: skip
    for name in sorted({e["name"] for e, _ in every}):
        own = [h for e, h in every if e["name"] == name]
        cause = next(e["cause"] for e, _ in every if e["name"] == name)
        rows.append([f"{name} (`{cause}`)", len(own), sum(own)])
    out.append(markdown("By form", ["hidden", "effects", "found"], rows))
    out.append(_left_out([s for s in scored if s.result["kind"] == "left-out"]))
    stated = [pair for s in scored for pair in s.stated]
    if stated:
        found = reliability(stated)
        rows = [[f"{100 * b['low']:.0f} to {100 * b['high']:.0f} %", b["right"]["of"], f"{100 * b['mean']:.1f} %",
                 share(b["right"]["hits"], b["right"]["of"])] for b in found["bins"]]  # fmt: skip
        rows.append(["**all**", found["number"], "", f"{found['right']}; Brier {found['brier']:.3f}"])
        out.append(markdown("Stated probabilities", ["stated", "causes", "mean", "right"], rows))
    if scored:
        cpu = np.array([s.result["cpu_s"] for s in scored])
        out.append(f"CPU {np.median(cpu):.1f} s in the median, {cpu.max():.1f} at most.")
    if failed := [r["error"].splitlines()[-1] for r in results if r["error"]]:
        out.append("\n".join(f"{n} x {e}" for e, n in Counter(failed).items()))
    return "\n\n".join(part for part in out if part)


def strangers(one: Scored) -> list[Item]:
    """Causes that were named and are not of the family of anything hidden; terms of a friction are one family."""
    hidden = [e["cause"] for e in one.result["truth"]["effects"] if e["cause"]]
    families = {CAUSES[cause].family for cause in hidden}
    rubs = any(cause in RUBS for cause in hidden)
    return [
        e for e in one.extras
        if e["cause"] != "law" and e["family"] not in families and not (rubs and e["cause"] in RUBS)
    ]  # fmt: skip


def _left_out(scored: Sequence[Scored]) -> str:
    """What becomes of a cause that the catalogue does not have, by what it is called."""
    groups: dict[str, list[Scored]] = {}
    for one in scored:
        groups.setdefault(one.result["truth"]["effects"][0]["cause"], []).append(one)
    rows = [[f"`{name}`", *_fate(own)] for name, own in sorted(groups.items())]
    header = [
        "left out",
        "sets",
        "nothing named",
        "laws alone",
        "in its family",
        "outside",
        "outside with over 50 %",
    ]
    return markdown("Left out", header, [*rows, ["**all**", *_fate(scored)]] if rows else [])


def _fate(own: Sequence[Scored]) -> list[int]:
    nothing = laws = inside = outside = sure = 0
    for one in own:
        causes = [e for e in one.extras if e["cause"] != "law"]
        others = strangers(one)
        nothing += not one.extras
        laws += bool(one.extras) and not causes
        inside += bool(causes) and not others
        outside += bool(others)
        sure += any(e["probability"] > 0.5 for e in others)
    return [len(own), nothing, laws, inside, outside, sure]


def misses(results: Iterable[Item]) -> str:
    """Every set that is not wholly right, in a line."""
    lines = []
    for r in results:
        if r["error"]:
            lines.append(f"{r['seed']} {r['kind']}: {r['error'].splitlines()[-1]}")
            continue
        one = score(r)
        if one.whole:
            continue
        hidden = [
            f"{e['name']} = {e['cause']}/{e['joint']} x{e['factor']:.1f} ({e['size']:.3g}){'' if hit else ' not found'}"
            for e, hit in zip(r["truth"]["effects"], one.hits, strict=True)
        ]
        verdict = r["verdict"]
        named = [f"{n['cause']}/{n.get('joint')} {100 * n['probability']:.0f} %" for n in verdict["causes"]]
        lines.append(
            f"{r['seed']} {r['kind']}: {'; '.join(hidden) or 'nothing'} | {verdict['verdict']}: "
            f"{'; '.join(named) or 'nothing'} | chi2/n {verdict['residual']['chi2_per_n']:.2f}, {r['cpu_s']:.0f} s"
        )
    return "\n".join(lines)


def share(hits: int, of: int) -> str:
    """With its 95 % band."""
    low, high = interval(hits, of)
    return f"{hits} ({100 * low:.0f} .. {100 * high:.0f} %)"


def counts(counter: Mapping[Any, int]) -> str:
    """In words."""
    return ", ".join(f"{name} {n}" for name, n in sorted(counter.items())) or "-"


def markdown(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table, or nothing."""
    if not rows:
        return ""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
