"""JSON form of a diagnosis: plain types, no NaN, units in the keys. A value that is not available is null.

format, version     "mocobot-diagnosis", 3; version 2 lacks ``machine``, ``finished`` and ``members``
machine             "team", or "joints" for one robot of hinges and slides. The latter also has ``told``, ``event``,
                    ``at``, ``reference`` and a limit's ``place``. Its ``prior_odds``, ``share_left``,
                    ``unlisted_nats``, ``nats`` of ``scatter`` and ``chi2_per_n`` of alternatives are null
finished            whether the search completed
recordings          names of the trials
reference           names of the trials of the robot in a healthy state
prior_odds          prior odds of any one cause, for all its places together
verdict             "consistent", "miscalibrated", "explained", "partly_explained" or "unexplained"
causes              list, in the order of discovery, of
    cause, family, robot, joint    robot and joint from 1, or null
    kind, name, place, sentence    in words: the cause, the cause at its place, its place, its effect
    parameters                     {name: {value, se}}; se is null for a value that was chosen, not fitted. For a
                                   cause of all joints (joint null, place "all joints") the medians over its members
    members                        list of {name, place, joint, parameters}, one for each place
    told                           list of {cause, place, name}: smallest set with 90 % of the probability, likeliest
                                   first
    event                          {trial (from 1), start_s, duration_s} for an event, else null; ``at`` has the first
                                   two of these
    explained                      {in_sample, held_out}: share of the nominal model's misfit that the cause removes
                                   beyond the causes before it; the shares add up to what all causes remove
    probability                    probability of this cause at this place
    over_nothing                   log odds over nothing in its place [nats], or null
    share_left                     where the cause acts, amplitude of the residual beyond noise over its own amplitude
    instead                        {nothing, unlisted}: probability of nothing, and of an unlisted effect with a
                                   similar trace; with ``probability`` and the alternatives' they add up to 1
    folds                          log odds that each trial, predicted from the others, gains from it [nats]; for a
                                   team with all tolerances in the model
    law                            for an unlisted law {place, unit, targets, function, of, times, numbers, formula,
                                   units of the parameters}: an error at ``targets`` that is a function of the signal
                                   ``of``, times the signal ``times`` if present; ``function`` names its terms
                                   (``formulas.formula``), ``spline`` if no formula matches. ``traces``: by trial
                                   {time_s, signal, error, se, law}, the curve fitted without a formula and the values
                                   of the formula, both minus their mean, one row for each target; else null
    shape                          parameters that the cause's columns depend on, such as a pendulum's length
    separate                       experiment that separates the cause from similar ones
    alternatives                   list of {cause, kind, name, family, robot, joint, place, probability,
                                   evidence_gap [nats], chi2_per_n, ambiguous, separate}; the probability follows from
                                   the rows; chi2_per_n of its closed loop, or null
places              possible places of something unlisted, likeliest first: {place, robot, joint, nats}; empty if
                    nothing unlisted remains
suspected           causes that explain a part but are too improbable to be named: list of {cause, kind, name, family,
                    robot, joint, place, at, sentence, probability, over_nothing}; with ``told``, all keys of causes
scatter             causes whose places all deviate by more than the tolerance, largest first: list of
    cause, kind, family, sentence
    factor                         their spread over the tolerance
    places                         number of places
    spread, tolerance              {name: size} of each parameter, standard deviations over the places
    nats                           log odds of the spread over the tolerance
    each                           {robot, joint, place, parameters: {name: {value, se}}} of each place, largest first
evidence            strongest candidates: {before, after} without findings and with the findings in the model (or
                    null), lists of {cause, kind, name, family, robot, joint, place, at, nats, needed}
gain                null if the closed loop was not simulated and there is nothing to estimate, or
    held_out        {before, after}: {<channel>_nrmse, <channel>_rms, chi2_per_n}, means over trials, null if failed;
                    as_found: with all healthy parts at their fitted values, too; null if only noise is left or if not
                    requested
    units           of the channels' rms
    noise           {<channel>_rms}: expected from noise and integration error alone
    removed         share of the excess error removed, with interval [low, high] over trials, or null
    trials          list of {name, before, after}
    validated       false if trials were compared with a fit to themselves: a single trial, or a named push or payload
                    mass of some trials
    estimates       {before, after}: payload estimates for the rig
    errors          {before, after} against the truth, only if it is known
not_simulated       reason why there is no closed-loop comparison, or null
rollouts            for serial robots: simulation from measured states, see ``joints.rolled``; else null
undecidable         list of {what, why, remedy}: what no recordings of this rig decide, then what these do not
detection_limits    list of {cause, kind, robot, joint, parameters: {name: size}}: sizes detectable with 90 %
                    probability; null if these recordings have no information
residual            {chi2_per_n, signature} of the residual with the causes (and tolerances), and
    chi2_per_n_tolerated           without causes, with all parameters as variable as their kind scatters
    unlisted_nats                  log odds of something unlisted over noise in the residual
    nominal                        {chi2_per_n, signature} of the simulation as it is
remains             sentences on what the verdict leaves open: misfit above noise, scatter, response
notes               sentences

``mocobot diagnose`` adds ``provenance``: versions, options and hashes of the input files (``mocobot.results``).
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
    """Convert numpy values to plain JSON values; non-finite numbers become null."""
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
"""Maximum length of each list of candidates in the evidence."""


class Told(ABC):
    """Converts a verdict to JSON values with words.

    Args:
        verdict: the verdict.
    """

    machine: ClassVar[str]

    def __init__(self, verdict: Verdict) -> None:
        self.verdict = verdict

    @abstractmethod
    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        """Cause and place as cause, kind, name, family, robot, joint and place."""

    @abstractmethod
    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """Sentence on the effect of a finding with its values; for several members, with their medians."""

    @abstractmethod
    def separate(self, cause: str) -> str:
        """Experiment that separates a cause from similar ones."""

    @abstractmethod
    def signature(self, which: str) -> Values:
        """Distribution of the misfit, ``before`` or ``after`` the findings."""

    def undecidable(self) -> list[Values]:
        """What no logs of such a machine can decide."""
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
            gain: effect of the findings on simulation and estimates, or None.
            not_simulated: reason why there is no closed-loop comparison, or None.
            rollouts: result of rollouts, or None.
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
        """One entry of ``causes`` or ``suspected``."""
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
        """One member of a finding."""
        at = self.at(f.cause, member.place, member.joint) if len(f.members) > 1 or f.joint is None else at
        numbers = _with_errors(member)
        return {"name": at["name"], "place": at["place"], "joint": member.joint, "parameters": numbers}

    def one_of_told(self, f: Finding, cause: str, place: str, own: Values) -> Values:
        """One entry of ``told``.

        A finding at one place may have been judged as a cause of all joints.
        """
        joints = {(rival.cause, rival.place): rival.joint for rival in f.rivals}
        if (cause, place) not in joints and cause == f.cause and place in (f.place, ALL):
            at = own
        elif cause in ("", "unlisted"):
            at = self.at("unlisted", f.place, f.joint, f.partner)
        else:
            at = self.at(cause, place, joints.get((cause, place)))
        return {key: at[key] for key in ("cause", "place", "name")}

    def rival(self, rival: Rival, alike: bool) -> Values:
        """One alternative to a finding."""
        return self.at(rival.cause, rival.place, rival.joint) | {
            "probability": rival.probability, "evidence_gap": rival.nats, "chi2_per_n": None, "ambiguous": alike,
            "separate": self.separate(rival.cause),
        }  # fmt: skip

    def scatter(self, entry: Scatter) -> Values:
        """One entry of ``scatter``."""
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
        """The gain of one more cause for each cause and place, in its likeliest shape, largest first."""
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
        """One entry of ``detection_limits``."""
        at = self.at(limit.cause, limit.place, limit.joint)
        place = {key: at[key] for key in ("cause", "kind", "robot", "joint", "place")}
        return place | {"parameters": dict(limit.sizes)}

    def blind_spots(self) -> list[Values]:
        """Causes and places without information in these logs."""
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
    """Sentences on scatter and on the remaining misfit."""
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
    """Medians over the members that have a parameter; prismatic and revolute joints have different parameters."""
    each: dict[str, list[float]] = {}
    for member in members:
        for name, value in member.values.items():
            each.setdefault(name, []).append(value)
    return {name: {"value": float(np.median(values)), "se": None} for name, values in each.items()}
