"""Hold what a diagnosis names against what was hidden."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discrepancy.team.causes import CAUSES
from mocobot.campaign.ground import one_axis
from mocobot_sim.effects.catalogue import EFFECTS

Item = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """How well one hidden effect was found.

    Attributes:
        effect: as the truth has it.
        factor: its size over the detection limit of its background.
        listed: whether the diagnosis' catalogue has the answer.
        named: cause that the verdict names for it, or None.
        family, member: whether family and cause are right.
        ambiguous: the wrong member, but the right one, at its place, is among those called ambiguous.
        place: whether the place is right, too.
        error: of the parameters that the truth knows, estimate minus truth over truth, the largest; None without any.
        deviations: estimate minus truth over the standard error of each.
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
        """Cause and place."""
        return self.place and (self.member or self.ambiguous)


@dataclass(frozen=True)
class Matched:
    """What a verdict names, held against everything that is hidden.

    Attributes:
        scores: one for every hidden effect.
        extras: what was named besides.
        stated: probability and rightness of everything that was named with a probability.
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
    """Score the causes of a diagnosis.

    Args:
        named: its ``causes``, as ``discrepancy.result.json`` documents them.
        truth: ``effects``, each with its right ``answer`` {cause, robot, joint, known: {parameter: value}}, and
            ``gimbal_axes_1`` (``campaign.ground``).
        factors: size of every effect over its detection limit.
        listed: whether the diagnosis could have named such an answer.
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
    """The named cause that comes nearest to a hidden one: place, then member, then family, then any."""

    def rank(item: Item) -> tuple[bool, bool, bool]:
        member = item["cause"] == effect["answer"]["cause"]
        return member and _same_place(item, effect, truth), member, item["family"] == family_of(effect)

    if not found:
        return None
    best = max(found, key=rank)
    return best if any(rank(best)) or alone else None  # among several hidden ones a stranger belongs to none


def family_of(effect: Item) -> str | None:
    """Family of the answer; None if the catalogue does not have it."""
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
    if item["cause"] == answer["cause"] == "gimbal_friction":  # parallel axes cannot be told apart
        return one_axis(truth["gimbal_axes_1"], item, answer)
    if answer["cause"] == "push":
        p, q = {name: entry["value"] for name, entry in item["parameters"].items()}, effect["parameters"]
        both = min(p["start_s"] + p["duration_s"], q["start_s"] + q["duration_s"])
        return p["trial"] == q["trial"] and both > max(p["start_s"], q["start_s"])
    if item["cause"] == answer["cause"] == "payload_mass":  # what is put on, or leaks out, and when
        p, known = {name: entry["value"] for name, entry in item["parameters"].items()}, answer["known"]
        alike = bool(p["rate_kgps"]) == bool(known.get("rate_kgps"))
        return alike and all(p[name] == known[name] for name in ("trial", "last_trial") if name in known)
    return _here(item) == _here(answer)


def _errors(item: Item, effect: Item) -> tuple[float | None, tuple[float, ...]]:
    """Of a push, where along its line and how long it acts cannot be told; nor is what masses decide."""
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
    if cause == "payload_mass":  # the size is the mass, however well its place shows
        units &= [name in ("mass_kg", "rate_kgps") for name in names]
    error = float(np.max(np.abs(away[units] / size[units]))) if units.any() else None
    return error, deviations


def _alike(names: Sequence[str]) -> bool:
    """Whether parameters have one unit, so that small ones do not count beside large ones."""
    return len({name.rsplit("_", 1)[-1] for name in names}) == 1
