"""JSON form of a verdict on a robot of joints; ``discrepancy.result.json`` documents the keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import stdtrit

from discrepancy.digits import three_digits
from discrepancy.evidence.settings import SETTINGS
from discrepancy.joints.causes import LINKS, WORDS
from discrepancy.joints.findings import Finding, Foretold, JointVerdict, Limit, Member, Offer, Rival, Scatter
from discrepancy.joints.model import SerialModel
from discrepancy.joints.said import Said, joint_in_words, link_in_words, titled
from discrepancy.result.json import plain
from discrepancy.result.read import FORMAT, VERSION
from discrepancy.result.remains import scatter_sentence
from estimator.arrays import Array

Values = dict[str, Any]
ALL = "all joints"
MOST_OFFERS = 14
"""Candidates of each list of the evidence."""


def verdict_to_dict(verdict: JointVerdict, rollouts: Mapping[str, Any] | None = None) -> Values:
    """The verdict as plain JSON values.

    Args:
        verdict: what was found.
        rollouts: what rollouts said, or None.
    """
    v, told = verdict, _Told(verdict)
    causes, (modelled, tolerated, left) = [told.finding(finding) for finding in v.findings], v.chi2_per_n
    unlisted = [cause for cause in causes if cause["cause"] == "unlisted"]
    values: Values = {
        "format": FORMAT, "version": VERSION, "machine": "joints", "finished": v.finished,
        "recordings": list(v.trials), "reference": list(v.reference), "prior_odds": None, "verdict": v.verdict,
        "causes": causes,
        "places": [
            {"place": c["place"], "robot": None, "joint": c["joint"], "nats": c["over_nothing"]} for c in unlisted
        ],
        "suspected": [told.finding(finding) for finding in v.suspected],
        "scatter": [told.scatter(entry) for entry in v.scatter],
        "foretold": None,
        "evidence": {"before": told.offers(v.before), "after": told.offers(v.after) if causes else None},
        "gain": _gain(v), "not_simulated": None, "rollouts": rollouts,
        "undecidable": told.blind_spots(),
        "detection_limits": [told.limit(limit) for limit in v.limits],
        "residual": {
            "chi2_per_n": left, "signature": _signature(v, "after"), "chi2_per_n_tolerated": tolerated,
            "unlisted_nats": None, "nominal": {"chi2_per_n": modelled, "signature": _signature(v, "before")},
        },
        "notes": list(v.notes),
    }  # fmt: skip
    kinds, remains = ", ".join(entry["kind"] for entry in values["scatter"]), []
    if kinds and v.verdict != "miscalibrated":
        remains = [f"Besides, all places alike are off by more than their tolerances: {kinds}."]
    if left > SETTINGS.clean_chi2:
        where = values["residual"]["signature"]["sentence"].replace("The torque", "the torque").rstrip(".")
        more = f"A misfit of chi2/n {three_digits(left)} of {three_digits(modelled)} remains; {where}."
        remains = [more, *remains]
    return plain(values | {"remains": remains})


class _Told:
    """Parts of a verdict as values with words.

    Args:
        verdict: which.
    """

    def __init__(self, verdict: JointVerdict) -> None:
        self.verdict, self.model = verdict, verdict.model
        self.than = "than in the reference" if verdict.reference else "than modelled"

    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        """Cause and place, in words too."""
        title = WORDS[cause].title if cause in WORDS else cause.replace("_", " ")
        if "{pair}" in title and joint is not None and partner is None:
            partner = joint - 1  # a drive is shared with the joint before
        where = self.where(cause, place, joint, partner)
        return {"cause": cause, "kind": titled(title), "name": titled(title, where), "family": cause, "robot": None,
                "joint": joint, "place": where}  # fmt: skip

    def where(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> str:
        """A place in words."""
        if joint is not None and partner is not None:
            return f"joints {min(joint, partner)} and {max(joint, partner)}"
        if cause in LINKS:
            return place if place.startswith("all ") else link_in_words(place)
        if joint is None and place in self.model.joints:
            joint = self.model.joints.index(place) + 1
        return place if joint is None else joint_in_words(joint, self.model.joints[joint - 1])

    def finding(self, f: Finding) -> Values:
        """An entry of ``causes`` and ``suspected``."""
        at, event = self.at(f.cause, f.place, f.joint, f.partner), f.event
        if f.of:
            at |= {key: f"{at[key]} by its {f.of}" for key in ("kind", "name")}
        members = [self.member(f, member, at) for member in f.members]
        parameters = _medians(f.members) if len(members) > 1 else members[0]["parameters"] if members else {}
        return at | {
            "at": event and [event.trial + 1, event.start_s],
            "event": event and {"trial": event.trial + 1, "start_s": event.start_s, "duration_s": event.duration_s},
            "sentence": self.sentence(f, at["place"], parameters),
            "parameters": parameters,
            "members": members,
            "explained": {"in_sample": f.in_sample, "held_out": f.held_out},
            "probability": f.probability, "over_nothing": f.over_nothing, "share_left": None,
            "instead": {"nothing": f.nothing, "unlisted": f.unlisted},
            "folds": list(f.folds), "law": None, "shape": dict(f.shape), "separate": _separate(f.cause),
            "told": [self.one_of_told(f, cause, place, at) for cause, place in f.told],
            "alternatives": [self.rival(rival, (rival.cause, rival.place) in f.told) for rival in f.rivals],
        }  # fmt: skip

    def member(self, f: Finding, member: Member, at: Values) -> Values:
        """One of a finding's places."""
        at = self.at(f.cause, member.place, member.joint) if len(f.members) > 1 or f.joint is None else at
        numbers = _with_errors(member)
        return {"name": at["name"], "place": at["place"], "joint": member.joint, "parameters": numbers}

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """What a finding does, with its numbers; for a kind with their medians."""
        numbers = {name: entry["value"] for name, entry in parameters.items()}
        errors = {name: entry["se"] for name, entry in parameters.items() if entry["se"] is not None}
        when = {"start_s": f.event.start_s, "duration_s": f.event.duration_s} if f.event else {}
        slides = [
            bool(self.model.slides[member.joint - 1]) for member in f.members if member.joint is not None
        ]
        if len(slides) > 1:
            mixed = len({tuple(member.values) for member in f.members}) > 1  # slides have other units
            count = slides.count(False) if mixed else len(slides)
            place = f"the typical joint{' that turns' if mixed else ''} (median of {count})"
        said = Said({**numbers, **f.shape, **when}, errors, place, bool(slides) and all(slides), self.than)
        cause = WORDS.get(f.cause)
        if cause is None or cause.sentence is None:
            listed = ", ".join(f"{name} {value:.3g}" for name, value in numbers.items())
            text = f"{titled(cause.title if cause else f.cause, place)}: {listed}"
        else:
            text = cause.sentence(said)
        if cause and len(slides) > 1:
            text = f"{titled(cause.title, ALL)}: {text}"
        if f.of:
            text = f"{text} and goes with its {f.of}"
        trials = self.verdict.trials
        trial = f" in {trials[f.event.trial]}" if f.event and len(trials) > 1 else ""
        return f"{text[:1].upper()}{text[1:]}{trial}."

    def one_of_told(self, f: Finding, cause: str, place: str, own: Values) -> Values:
        """One of the causes that may be there; a finding at one place may have been judged as one of all joints."""
        joints = {(rival.cause, rival.place): rival.joint for rival in f.rivals}
        if (cause, place) not in joints and cause == f.cause and place in (f.place, ALL):
            at = own
        elif cause in ("", "unlisted"):
            at = self.at("unlisted", f.place, f.joint, f.partner)
        else:
            at = self.at(cause, place, joints.get((cause, place)))
        return {key: at[key] for key in ("cause", "place", "name")}

    def rival(self, rival: Rival, alike: bool) -> Values:
        """What else may be in a finding's place."""
        return self.at(rival.cause, rival.place, rival.joint) | {
            "probability": rival.probability, "evidence_gap": rival.nats, "chi2_per_n": None, "ambiguous": alike,
            "separate": _separate(rival.cause),
        }  # fmt: skip

    def scatter(self, entry: Scatter) -> Values:
        """A kind that is off everywhere."""
        places = [self.where(entry.cause, member.place, member.joint) for member in entry.members]
        values: Values = {
            "cause": entry.cause, "kind": self.at(entry.cause, ALL, None)["kind"], "family": entry.cause,
            "factor": entry.factor, "places": len(places), "nats": None, "tolerance": dict(entry.tolerance),
            "spread": {name: entry.factor * size for name, size in entry.tolerance.items()},
            "each": [
                {"robot": None, "joint": member.joint, "place": place, "parameters": _with_errors(member)}
                for member, place in zip(entry.members, places, strict=True)
            ],
        }  # fmt: skip
        return values | {"sentence": scatter_sentence(values)}

    def offers(self, offers: Sequence[Offer]) -> list[Values]:
        """What one more cause would gain, the most first; each in its likeliest shape."""
        best: dict[tuple[str, str], Offer] = {}
        for offer in sorted(offers, key=lambda offer: -offer.nats):
            best.setdefault((offer.cause, offer.place), offer)
        return [
            self.at(offer.cause, offer.place, offer.joint)
            | {"at": None, "nats": offer.nats, "needed": SETTINGS.need_nats}
            for offer in list(best.values())[:MOST_OFFERS]
            if offer.nats > 0.0
        ]

    def limit(self, limit: Limit) -> Values:
        """What would have been noticed."""
        at = self.at(limit.cause, limit.place, limit.joint)
        place = {key: at[key] for key in ("cause", "kind", "robot", "joint", "place")}
        return place | {"parameters": dict(limit.sizes)}

    def blind_spots(self) -> list[Values]:
        """Causes and places of which these logs say nothing."""
        places: dict[str, list[str]] = {}
        for limit in map(self.limit, self.verdict.limits):
            if limit["parameters"] and not any(limit["parameters"].values()):
                places.setdefault(limit["kind"], []).append(limit["place"])
        why, remedy = (
            "its trace in these logs cannot be told from the unknowns",
            "motion in more directions, where any helps",
        )
        return [
            {"what": f"{kind} ({'; '.join(w)})", "why": why, "remedy": remedy} for kind, w in places.items()
        ]


def _separate(cause: str) -> str:
    return WORDS[cause].separate if cause in WORDS else ""


def _with_errors(member: Member) -> Values:
    errors = {name: error for name, error in member.errors.items() if error > 0.0}
    return {name: {"value": float(value), "se": errors.get(name)} for name, value in member.values.items()}


def _medians(members: Iterable[Member]) -> Values:
    """Of the members that have a parameter; joints that slide have others than joints that turn."""
    each: dict[str, list[float]] = {}
    for member in members:
        for name, value in member.values.items():
            each.setdefault(name, []).append(value)
    return {name: {"value": float(np.median(values)), "se": None} for name, values in each.items()}


def _gain(verdict: JointVerdict) -> Values | None:
    """Torques foretold without and with the findings."""
    if not verdict.foretold:
        return None
    foretold, known = verdict.foretold, _known(verdict)
    names = {j: f"{verdict.model.joints[j]} torque" for j in known}

    def errors(one: Foretold, which: str) -> dict[str, float]:
        rms = getattr(one, which)
        sizes = {f"{name}_rms": float(rms[j]) for j, name in names.items()}
        sizes |= {f"{name}_nrmse": float(rms[j] / one.torque[j]) for j, name in names.items()}
        return sizes | {"chi2_per_n": float(getattr(one, f"chi2_{which}"))}

    sides = {which: [errors(one, which) for one in foretold] for which in ("before", "after")}
    both = zip(foretold, sides["before"], sides["after"], strict=True)
    noise = np.sqrt(np.mean([np.square(one.noise) for one in foretold], axis=0))
    return {
        "held_out": {which: _means(each) for which, each in sides.items()} | {"as_found": None},
        "units": {name: unit_of(verdict.model, j) for j, name in names.items()},
        "noise": {f"{name}_rms": float(noise[j]) for j, name in names.items()},
        "removed": _removed(foretold) if verdict.findings else None,
        "validated": verdict.validated,
        "trials": [{"name": one.trial, "before": before, "after": after} for one, before, after in both],
    }


def unit_of(model: SerialModel, joint: int) -> str:
    """Unit of a joint's torque, by its number from 0."""
    return "N" if model.slides[joint] else "N m"


def _known(verdict: JointVerdict) -> list[int]:
    """Joints whose torques were foretold in all trials."""
    sizes = np.array([[f.before, f.after, f.noise, f.torque] for f in verdict.foretold])
    there = np.isfinite(sizes).all(axis=(0, 1)) & (sizes[:, 2:] > 0.0).all(axis=(0, 1))
    return [int(j) for j in np.flatnonzero(there)]


def _means(each: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([one[key] for one in each])) for key in each[0]}


def _removed(foretold: Sequence[Foretold]) -> Values | None:
    """Share of the error beyond noise: mean over the trials, 95 % interval."""
    shares = [1.0 - _excess(f.chi2_after) / _excess(f.chi2_before) for f in foretold if f.chi2_before > 1.0]
    if not shares:
        return None
    mean, count = float(np.mean(shares)), len(shares)
    half = float(stdtrit(count - 1, 0.975) * np.std(shares, ddof=1) / np.sqrt(count)) if count > 1 else np.inf
    return {"share": mean, "interval": [mean - half, min(1.0, mean + half)]}


def _excess(chi2_per_n: float) -> float:
    return float(np.sqrt(max(chi2_per_n - 1.0, 0.0)))


def _signature(verdict: JointVerdict, which: str) -> Values:
    """Where the misfit is, by joint and trial; ``before`` or ``after``."""
    known, joints = _known(verdict) if verdict.foretold else [], verdict.model.joints
    squares: list[Array] = [
        np.square(getattr(f, which) / np.where(f.noise > 0, f.noise, 1.0)) for f in verdict.foretold
    ]
    channel = {j: float(np.mean([square[j] for square in squares])) for j in known}
    worst = max(known, key=lambda j: channel[j], default=None)
    said = "No torque was foretold."
    if worst is not None:
        place = joint_in_words(worst + 1, joints[worst])
        said = f"The torque of {place} is off most, by chi2/n {three_digits(channel[worst])}."
    return {
        "chi2_per_n": verdict.chi2_per_n[0 if which == "before" else 2],
        "kind": {},
        "channel": {f"{joints[j]} torque": size for j, size in channel.items()},
        "trial": {f.trial: float(getattr(f, f"chi2_{which}")) for f in verdict.foretold},
        "sentence": said,
    }
