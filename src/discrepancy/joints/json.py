"""JSON form of a verdict on a robot of joints; ``discrepancy.result.json`` documents the keys."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import stdtrit

from discrepancy import rules
from discrepancy.digits import three_digits
from discrepancy.evidence.settings import SETTINGS
from discrepancy.joints.causes import WORDS
from discrepancy.joints.findings import Finding, Foretold, JointVerdict, Limit, Member, Offer, Rival, Scatter
from discrepancy.joints.said import Said, joint_in_words, link_in_words, titled
from discrepancy.result.json import plain
from discrepancy.result.read import FORMAT, VERSION
from discrepancy.result.remains import of_scatter, scatter_sentence
from discrepancy.serial.model import SerialModel
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
    told = _Told(verdict)
    causes = [told.finding(finding) for finding in verdict.findings]
    modelled, tolerated, left = verdict.chi2_per_n
    values = {
        "format": FORMAT,
        "version": VERSION,
        "machine": "joints",
        "finished": verdict.finished,
        "recordings": list(verdict.trials),
        "reference": list(verdict.reference),
        "prior_odds": None,
        "verdict": verdict.verdict,
        "causes": causes,
        "places": [
            {"place": cause["place"], "robot": None, "joint": cause["joint"], "nats": cause["over_nothing"]}
            for cause in causes
            if cause["cause"] == "unlisted"
        ],
        "suspected": [told.finding(finding) for finding in verdict.suspected],
        "scatter": [told.scatter(entry) for entry in verdict.scatter],
        "foretold": None,
        "evidence": {
            "before": told.offers(verdict.before),
            "after": told.offers(verdict.after) if verdict.findings else None,
        },
        "gain": _gain(verdict),
        "not_simulated": None,
        "rollouts": rollouts,
        "undecidable": told.blind_spots(),
        "detection_limits": [told.limit(limit) for limit in verdict.limits],
        "residual": {
            "chi2_per_n": left,
            "signature": _signature(verdict, "after"),
            "chi2_per_n_tolerated": tolerated,
            "unlisted_nats": None,
            "nominal": {"chi2_per_n": modelled, "signature": _signature(verdict, "before")},
        },
        "notes": list(verdict.notes),
    }
    return plain(values | {"remains": _remains(values)})


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
        where = self.where(cause, place, joint, partner)
        return {
            "cause": cause,
            "kind": titled(title),
            "name": titled(title, where),
            "family": cause,
            "robot": None,
            "joint": joint,
            "place": where,
        }

    def where(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> str:
        """A place in words."""
        if joint is not None and partner is not None:
            return f"joints {min(joint, partner)} and {max(joint, partner)}"
        if joint is None and place in self.model.joints:
            joint = self.model.joints.index(place) + 1
        if joint is not None:
            return joint_in_words(
                joint, place if place in self.model.joints else self.model.joints[joint - 1]
            )
        is_link = cause in WORDS and "link" in WORDS[cause].title and not place.startswith("all ")
        return link_in_words(place) if is_link else place

    def finding(self, finding: Finding) -> Values:
        """An entry of ``causes`` and ``suspected``."""
        f, several = finding, len(finding.members) > 1
        at = self.at(f.cause, f.place, f.joint, f.partner)
        event = f.event and {
            "trial": f.event.trial + 1,
            "start_s": f.event.start_s,
            "duration_s": f.event.duration_s,
        }
        members = [self.member(f, member, at) for member in f.members]
        parameters = _medians(f.members) if several else (members[0]["parameters"] if members else {})
        listed = set(f.told)
        return at | {
            "at": event and [event["trial"], event["start_s"]],
            "event": event,
            "sentence": self.sentence(f, at["place"], parameters),
            "parameters": parameters,
            "members": members,
            "explained": {"in_sample": f.in_sample, "held_out": f.held_out},
            "probability": f.probability,
            "over_nothing": f.over_nothing,
            "share_left": None,
            "instead": {"nothing": f.nothing, "unlisted": f.unlisted},
            "folds": list(f.folds),
            "law": None,
            "shape": dict(f.shape),
            "separate": _separate(f.cause),
            "told": [self.one_of_told(f, cause, place) for cause, place in f.told],
            "alternatives": [self.rival(rival, (rival.cause, rival.place) in listed) for rival in f.rivals],
        }

    def member(self, f: Finding, member: Member, at: Values) -> Values:
        """One of a finding's places."""
        if len(f.members) > 1 or f.joint is None:
            at = self.at(f.cause, member.place, member.joint)
        return {
            "name": at["name"],
            "place": at["place"],
            "joint": member.joint,
            "parameters": _with_errors(member.values, member.errors),
        }

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """What a finding does, with its numbers; for a kind with their medians."""
        numbers = {name: entry["value"] for name, entry in parameters.items()}
        errors = {name: entry["se"] for name, entry in parameters.items() if entry["se"] is not None}
        when = {"start_s": f.event.start_s, "duration_s": f.event.duration_s} if f.event else {}
        at = [member.joint - 1 for member in f.members if member.joint is not None]
        sliding = [j for j in at if self.model.slides[j]]
        slide = bool(at) and sliding == at
        if len(at) > 1:
            told = "joint" if slide or not sliding else "joint that turns"
            place = f"the typical {told} (median of {len(at) - (0 if slide else len(sliding))})"
        said = Said({**numbers, **f.shape, **when}, errors, place, slide, self.than)
        cause = WORDS.get(f.cause)
        if cause is None or cause.sentence is None:
            text = f"{cause.title if cause else f.cause}: " + ", ".join(
                f"{k} {v:.3g}" for k, v in numbers.items()
            )
            text = titled(text, place)
        else:
            text = cause.sentence(said)
        if len(at) > 1:
            text = f"{titled(cause.title, ALL) if cause else f.cause}: {text}"
        trials = self.verdict.trials
        trial = f" in {trials[f.event.trial]}" if f.event and len(trials) > 1 else ""
        return f"{text[:1].upper()}{text[1:]}{trial}."

    def one_of_told(self, f: Finding, cause: str, place: str) -> Values:
        """One of the causes that may be there."""
        if not cause or cause == "unlisted":
            here = self.where(f.cause, f.place, f.joint, f.partner)
            return {"cause": "unlisted", "place": here, "name": f"something unlisted at {here}"}
        if (cause, place) == (f.cause, f.place):
            at = self.at(cause, place, f.joint, f.partner)
        else:
            joint = next((r.joint for r in f.rivals if (r.cause, r.place) == (cause, place)), None)
            at = self.at(cause, place, joint)
        return {key: at[key] for key in ("cause", "place", "name")}

    def rival(self, rival: Rival, alike: bool) -> Values:
        """What else may be in a finding's place."""
        return self.at(rival.cause, rival.place, rival.joint) | {
            "probability": rival.probability,
            "evidence_gap": rival.nats,
            "chi2_per_n": None,
            "ambiguous": alike,
            "separate": _separate(rival.cause),
        }

    def scatter(self, entry: Scatter) -> Values:
        """A kind that is off everywhere."""
        at = self.at(entry.cause, ALL, None)
        tolerance = dict(entry.tolerance)
        values: Values = {
            "cause": entry.cause,
            "kind": at["kind"],
            "family": entry.cause,
            "factor": entry.factor,
            "places": len(entry.members),
            "spread": {name: entry.factor * size for name, size in tolerance.items()},
            "tolerance": tolerance,
            "nats": None,
            "each": [
                {
                    "robot": None,
                    "joint": member.joint,
                    "place": self.where(entry.cause, member.place, member.joint),
                    "parameters": _with_errors(member.values, member.errors),
                }
                for member in entry.members
            ],
        }
        return values | {"sentence": scatter_sentence(values)}

    def offers(self, offers: Sequence[Offer]) -> list[Values]:
        """What one more cause would gain, the most first."""
        ranked = sorted(offers, key=lambda offer: -offer.nats)[:MOST_OFFERS]
        return [
            self.at(offer.cause, offer.place, offer.joint)
            | {"at": None, "nats": offer.nats, "needed": SETTINGS.need_nats}
            for offer in ranked
            if offer.nats > 0.0
        ]

    def limit(self, limit: Limit) -> Values:
        """What would have been noticed."""
        at = self.at(limit.cause, limit.place, limit.joint)
        return {key: at[key] for key in ("cause", "kind", "robot", "joint", "place")} | {
            "parameters": dict(limit.sizes)
        }

    def blind_spots(self) -> list[Values]:
        """Causes and places of which these logs say nothing."""
        places: dict[str, list[str]] = {}
        for limit in self.verdict.limits:
            if limit.sizes and all(size is None for size in limit.sizes.values()):
                at = self.at(limit.cause, limit.place, limit.joint)
                places.setdefault(at["kind"], []).append(at["place"])
        return [
            {
                "what": f"{kind} ({'; '.join(where)})",
                "why": "its trace in these logs cannot be told from the unknowns",
                "remedy": "motion in more directions, where any helps",
            }
            for kind, where in places.items()
        ]


def _separate(cause: str) -> str:
    return WORDS[cause].separate if cause in WORDS else ""


def _with_errors(values: Mapping[str, float], errors: Mapping[str, float]) -> Values:
    return {
        name: {"value": float(value), "se": error if (error := errors.get(name, 0.0)) > 0.0 else None}
        for name, value in values.items()
    }


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
    units = {f"{verdict.model.joints[j]} torque": unit_of(verdict.model, j) for j in _known(verdict)}
    trials = [
        {
            "name": one.trial,
            "before": _errors(verdict, one.before, one.torque, one.chi2_before),
            "after": _errors(verdict, one.after, one.torque, one.chi2_after),
        }
        for one in verdict.foretold
    ]
    noise = np.sqrt(np.mean([np.square(one.noise[_known(verdict)]) for one in verdict.foretold], axis=0))
    return {
        "held_out": {which: _means([t[which] for t in trials]) for which in ("before", "after")}
        | {"as_found": None},
        "units": units,
        "noise": {f"{name}_rms": float(x) for name, x in zip(units, noise, strict=True)},
        "removed": _removed(verdict.foretold) if verdict.findings else None,
        "validated": verdict.validated,
        "trials": trials,
    }


def unit_of(model: SerialModel, joint: int) -> str:
    """Unit of a joint's torque, by its number from 0."""
    return "N" if model.slides[joint] else "N m"


def _known(verdict: JointVerdict) -> list[int]:
    """Joints whose torques were foretold in all trials."""
    sizes = np.array([[f.before, f.after, f.noise, f.torque] for f in verdict.foretold])
    there = np.isfinite(sizes).all(axis=(0, 1)) & (sizes[:, 2:] > 0.0).all(axis=(0, 1))
    return [int(j) for j in np.flatnonzero(there)]


def _errors(verdict: JointVerdict, rms: Array, torque: Array, chi2: float) -> dict[str, float]:
    out: dict[str, float] = {}
    for j in _known(verdict):
        name = f"{verdict.model.joints[j]} torque"
        out |= {f"{name}_rms": float(rms[j]), f"{name}_nrmse": float(rms[j] / torque[j])}
    return out | {"chi2_per_n": float(chi2)}


def _means(each: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([one[key] for one in each])) for key in each[0]}


def _removed(foretold: Sequence[Foretold]) -> Values | None:
    """Share of the error beyond noise: mean over the trials, 95 % interval."""
    shares = [
        1.0 - _excess(one.chi2_after) / _excess(one.chi2_before) for one in foretold if one.chi2_before > 1.0
    ]
    if not shares:
        return None
    mean, count = float(np.mean(shares)), len(shares)
    if count < 2:
        return {"share": mean, "interval": [None, 1.0]}
    half = float(stdtrit(count - 1, 0.975) * np.std(shares, ddof=1) / np.sqrt(count))
    return {"share": mean, "interval": [mean - half, min(1.0, mean + half)]}


def _excess(chi2_per_n: float) -> float:
    return float(np.sqrt(max(chi2_per_n - 1.0, 0.0)))


def _signature(verdict: JointVerdict, which: str) -> Values:
    """Where the misfit is, by joint and trial; ``before`` or ``after``."""
    channel, trial, known = {}, {}, _known(verdict) if verdict.foretold else []
    if verdict.foretold:
        errors, noise = ([getattr(f, name)[known] for f in verdict.foretold] for name in (which, "noise"))
        squares = np.mean(np.square(np.divide(errors, noise)), axis=0)
        channel = {f"{verdict.model.joints[j]} torque": float(x) for j, x in zip(known, squares, strict=True)}
        trial = {f.trial: float(getattr(f, f"chi2_{which}")) for f in verdict.foretold}
    chi2 = verdict.chi2_per_n[0 if which == "before" else 2]
    return {
        "chi2_per_n": chi2,
        "kind": {},
        "channel": channel,
        "trial": trial,
        "sentence": _worst(verdict, channel),
    }


def _worst(verdict: JointVerdict, channel: Mapping[str, float]) -> str:
    if not channel:
        return "No trial was foretold."
    called = max(channel, key=lambda name: channel[name]).removesuffix(" torque")
    name = joint_in_words(verdict.model.joints.index(called) + 1, called)
    return f"The torque of {name} is off most, by chi2/n {three_digits(max(channel.values()))}."


def _remains(values: Values) -> list[str]:
    """Sentences on what is left open."""
    residual, out = values["residual"], []
    left, before = residual["chi2_per_n"], residual["nominal"]["chi2_per_n"]
    if left > rules.CLEAN_CHI2_PER_N:
        worst = re.sub(r"^The", "the", residual["signature"]["sentence"].rstrip("."))
        out.append(f"A misfit of chi2/n {three_digits(left)} of {three_digits(before)} remains; {worst}.")
    return [*out, *of_scatter(values)]
