"""JSON form of a diagnosis: plain types, no NaN, units in the keys; null is what could not be had.

format, version     "mocobot-diagnosis", 3; version 2 has no ``machine``, ``finished`` and ``members``
machine             "team", or "joints" of one robot of hinges and slides. A verdict of ``discrepancy.evidence`` on it
                    (``discrepancy.result.json``) has ``told``, ``event``, ``at``, ``reference`` and a limit's ``place``
                    besides. In it ``prior_odds``, ``share_left``, ``foretold``, ``unlisted_nats``, ``nats`` of
                    ``scatter`` and ``chi2_per_n`` of alternatives are null
finished            whether the search came to its end
recordings          names of the trials
reference           names of the trials of the robot while it was well
prior_odds          of any cause being there before the data are seen, at all its places together
verdict             "consistent", "miscalibrated", "explained", "partly_explained" or "unexplained"
causes              list, in the order of discovery, of
    cause, family, robot, joint    robot and joint from 1, or null
    kind, name, place, sentence    in words: the cause, the cause at its place, its place, what it does
    parameters                     {name: {value, se}}; se is null for what was chosen, not fitted; of a cause of all
                                   joints (joint null, place "all joints") the medians over its members
    members                        list of {name, place, joint, parameters}, one a place
    told                           list of {cause, place, name}: the smallest set that holds 90 %, the likeliest first
    event                          {trial (from 1), start_s, duration_s} of what acted once, else null; ``at`` has its
                                   first two numbers
    explained                      {in_sample, held_out}: share of the nominal model's misfit that the cause removes
                                   beyond those before it; the shares add up to what all causes remove
    probability                    that it is this cause, at this place
    over_nothing                   by how much it is likelier than nothing in its place [nats], or null
    share_left                     where it acts, amplitude of what is left beyond noise over that of what it explains
    instead                        {nothing, unlisted}: probabilities that nothing is there, or something that is not
                                   in the catalogue and looks like it; with ``probability`` and those of the
                                   alternatives they add up to 1
    folds                          nats by which every trial is likelier with it, predicted by the others; of a team
                                   beside everything that is off within its tolerance
    law                            of what no catalogue lists {place, unit, targets, function, of, times, numbers,
                                   formula, units of the parameters}: an error at ``targets`` that is a function of
                                   ``of``, times the signal ``times`` if there is one; ``function`` names its terms
                                   (``formulas.formula``), ``spline`` where no formula says the curve. ``traces``: by
                                   trial {time_s, signal, error, se, law}, the curve as it was found without a formula
                                   and what the formula says, both about their mean, one row a target; else null
    shape                          numbers that change the cause's columns, such as a pendulum's length
    separate                       what would tell the cause from its look-alikes
    alternatives                   list of {cause, kind, name, family, robot, joint, place, probability,
                                   evidence_gap [nats], chi2_per_n, ambiguous, separate}; the probability by the rows;
                                   chi2_per_n of its closed loop, or null
places              where something unlisted was looked for, the likeliest first: {place, robot, joint, nats}; empty
                    where nothing unlisted is left
suspected           what would explain some of it, but is not probable enough to be named: list of {cause, kind, name,
                    family, robot, joint, place, at, sentence, probability, over_nothing}; where ``told``
                    is, all that causes have
scatter             kinds of which all places are off by more than the tolerance, the farthest first: list of
    cause, kind, family, sentence
    factor                         their spread over the tolerance
    places                         how many there are
    spread, tolerance              {name: size} of every parameter, standard deviations over the places
    nats                           by how much the spread is likelier than the tolerance
    each                           {robot, joint, place, parameters: {name: {value, se}}} of every place, the farthest
                                   off first
foretold            {as_designed, as_found}: chi2/n of trials left out, the machine as designed and as the other trials
                    find it; null where nothing scatters, or for a single trial
evidence            the strongest candidates: {before, after} with nothing found and with what
                    is found (null), lists of {cause, kind, name, family, robot, joint, place, at, nats, needed}
gain                null where the closed loop was not simulated and there is nothing to estimate, or
    held_out        {before, after}: {<channel>_nrmse, <channel>_rms, chi2_per_n}, means over trials, null if failed;
                    as_found: with every healthy part as it is found, too; null where noise is left without or not asked
    units           of the channels' rms
    noise           {<channel>_rms}: what noise and integration error alone would leave
    removed         share of the excess error removed, with interval [low, high] over trials, or null
    trials          list of {name, before, after}
    validated       false where trials were compared with what they were fitted to: a single one, or a push or a
                    payload's mass of some trials named
    estimates       {before, after}, as the rig has them
    errors          {before, after} against the truth, only where it is known
not_simulated       why there is no closed-loop comparison, or null
rollouts            of serial robots: measured states let go in simulation, see ``joints.rolled``; else null
undecidable         list of {what, why, remedy}: what no recordings of this rig decide, then what these do not
detection_limits    list of {cause, kind, robot, joint, parameters: {name: size}}: what would have been noticed nine
                    times in ten; null where these recordings say nothing
residual            {chi2_per_n, signature} of what the causes (with tolerances) leave, and
    chi2_per_n_tolerated           with no cause, and everything off as far as its kind scatters
    unlisted_nats                  by how much what is left is likelier something than clean noise
    nominal                        {chi2_per_n, signature} of the simulation as it is
remains             sentences on what the verdict leaves open: misfit above clean, what is off everywhere, response
notes               sentences

``mocobot diagnose`` adds ``provenance``: versions, options and hashes of the files it was made from
(``mocobot.results``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from discrepancy.evidence.findings import Finding, Limit, Member, Offer, Rival, Scatter, Verdict
from discrepancy.evidence.settings import SETTINGS
from discrepancy.numbers import three_digits
from discrepancy.result.read import FORMAT, VERSION
from discrepancy.result.remains import scatter_sentence


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def plain(value: Any) -> Any:
    """numpy numbers and arrays to plain JSON values; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    return _finite(float(value)) if isinstance(value, float | np.floating) else value


Values = dict[str, Any]
ALL = "all joints"
MOST_OFFERS = 14
"""Candidates of each list of the evidence."""


class Told(ABC):
    """Parts of a verdict as values with words.

    Args:
        verdict: which.
    """

    machine: ClassVar[str]

    def __init__(self, verdict: Verdict) -> None:
        self.verdict = verdict

    @abstractmethod
    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        """Cause and place, in words too: cause, kind, name, family, robot, joint, place."""

    @abstractmethod
    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """What a finding does, with its numbers; for a kind with their medians."""

    @abstractmethod
    def separate(self, cause: str) -> str:
        """What would tell a cause from its look-alikes."""

    @abstractmethod
    def signature(self, which: str) -> Values:
        """Where the misfit is; ``before`` or ``after``."""

    def undecidable(self) -> list[Values]:
        """What no logs of such a machine decide."""
        return []

    def values(
        self,
        gain: Values | None,
        *,
        not_simulated: str | None = None,
        rollouts: Mapping[str, Any] | None = None,
    ) -> Values:
        """The verdict as plain JSON values.

        Args:
            gain: what the findings are worth to a simulation and to estimates, or None.
            not_simulated: why there is no comparison in closed loop, or None.
            rollouts: what rollouts said, or None.
        """
        v, (modelled, tolerated, left) = self.verdict, self.verdict.chi2_per_n
        causes = [self.finding(finding) for finding in v.findings]
        values: Values = {
            "format": FORMAT, "version": VERSION, "machine": self.machine, "finished": v.finished,
            "recordings": list(v.trials), "reference": list(v.reference), "prior_odds": None, "verdict": v.verdict,
            "causes": causes,
            "places": [
                {"place": c["place"], "robot": c["robot"], "joint": c["joint"], "nats": c["over_nothing"]}
                for c in causes if c["cause"] == "unlisted"
            ],
            "suspected": [self.finding(finding) for finding in v.suspected],
            "scatter": [self.scatter(entry) for entry in v.scatter],
            "foretold": None,
            "evidence": {"before": self.offers(v.before), "after": self.offers(v.after) if causes else None},
            "gain": gain, "not_simulated": not_simulated, "rollouts": rollouts,
            "undecidable": [*self.undecidable(), *self.blind_spots()],
            "detection_limits": [self.limit(limit) for limit in v.limits],
            "residual": {
                "chi2_per_n": left, "signature": self.signature("after"), "chi2_per_n_tolerated": tolerated,
                "unlisted_nats": None, "nominal": {"chi2_per_n": modelled, "signature": self.signature("before")},
            },
            "notes": list(v.notes),
        }  # fmt: skip
        return plain(values | {"remains": _remains(values)})

    def finding(self, f: Finding) -> Values:
        """An entry of ``causes`` and ``suspected``."""
        at, event = self.at(f.cause, f.place, f.joint, f.partner), f.event
        at |= {"robot": f.law.robot, "joint": f.law.joint} if f.law else {}
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
            "folds": list(f.folds), "law": f.law and f.law.to_dict(), "shape": dict(f.shape),
            "separate": self.separate(f.cause),
            "told": [self.one_of_told(f, cause, place, at) for cause, place in f.told],
            "alternatives": [self.rival(rival, (rival.cause, rival.place) in f.told) for rival in f.rivals],
        }  # fmt: skip

    def member(self, f: Finding, member: Member, at: Values) -> Values:
        """One of a finding's places."""
        at = self.at(f.cause, member.place, member.joint) if len(f.members) > 1 or f.joint is None else at
        numbers = _with_errors(member)
        return {"name": at["name"], "place": at["place"], "joint": member.joint, "parameters": numbers}

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
            "separate": self.separate(rival.cause),
        }  # fmt: skip

    def scatter(self, entry: Scatter) -> Values:
        """A kind that is off everywhere."""
        places = [self.at(entry.cause, member.place, member.joint) for member in entry.members]
        values: Values = {
            "cause": entry.cause, "kind": self.at(entry.cause, ALL, None)["kind"], "family": entry.cause,
            "factor": entry.factor, "places": len(places), "nats": None, "tolerance": dict(entry.tolerance),
            "spread": {name: entry.factor * size for name, size in entry.tolerance.items()},
            "each": [
                {key: at[key] for key in ("robot", "joint", "place")} | {"parameters": _with_errors(member)}
                for member, at in zip(entry.members, places, strict=True)
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


def _remains(values: Values) -> list[str]:
    """Sentences on kinds that are off everywhere, and on the misfit that is left."""
    kinds, out, residual = ", ".join(entry["kind"] for entry in values["scatter"]), [], values["residual"]
    if kinds and values["verdict"] != "miscalibrated":
        out = [f"Besides, all places alike are off by more than their tolerances: {kinds}."]
    if residual["chi2_per_n"] > SETTINGS.clean_chi2:
        where, of = (
            residual["signature"]["sentence"].rstrip("."),
            three_digits(residual["nominal"]["chi2_per_n"]),
        )
        left = three_digits(residual["chi2_per_n"])
        out = [f"A misfit of chi2/n {left} of {of} remains; {where[:1].lower()}{where[1:]}.", *out]
    return out


def _with_errors(member: Member) -> Values:
    errors = {name: error for name, error in member.errors.items() if error > 0.0}
    return {name: {"value": float(value), "se": errors.get(name)} for name, value in member.values.items()}


def _medians(members: Iterable[Member]) -> Values:
    """Medians over members that have a parameter: joints that slide have others than joints that turn."""
    each: dict[str, list[float]] = {}
    for member in members:
        for name, value in member.values.items():
            each.setdefault(name, []).append(value)
    return {name: {"value": float(np.median(values)), "se": None} for name, values in each.items()}
