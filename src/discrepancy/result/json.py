"""JSON form of a diagnosis: plain types, no NaN, units in the keys; null is what could not be had.

format, version     "mocobot-diagnosis", 3; version 2 has no ``machine``, ``finished`` and ``members``
machine             "team", or "joints" of one robot of hinges and slides. A verdict of ``discrepancy.evidence`` on it
                    (``discrepancy.result.told``) has ``told``, ``event``, ``at``, ``reference`` and a limit's ``place``
                    besides. In it ``prior_odds``, ``share_left``, ``law``, ``foretold``, ``unlisted_nats``, ``nats`` of
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
    folds                          nats by which every trial is likelier with it, foretold by the others; of a team
                                   beside everything that is off within its tolerance
    law                            of what no catalogue lists {place, unit, targets, function, of, times, numbers,
                                   formula, units of the parameters}: an error at ``targets`` that is a function of
                                   signals, and ``traces`` of the error as it was located beside it
                                   (``laws.said.trace``); else null
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
evidence            the strongest candidates, see ``evidence_list``: {before, after} with nothing found and with what
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
rollouts            of serial robots: measured states let go in simulation, see ``joints.rolled.told``; else null
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
(``mocobot.files.provenance``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from discrepancy.causes.words import Words
from discrepancy.engine.confirm import Alternative, decided_gap
from discrepancy.engine.diagnose import Diagnosis
from discrepancy.engine.explanation import Found
from discrepancy.inference.probability import parted
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.numbers import law_to_dict, physical
from discrepancy.laws.said.trace import places_to_dict, traces_of
from discrepancy.laws.said.units import units_of
from discrepancy.laws.where import Located
from discrepancy.least_squares.fit import Fit
from discrepancy.result.evidence_list import at_of, evidence_list, place_of
from discrepancy.result.read import FORMAT, VERSION
from discrepancy.result.remains import remains, scatter_to_dict
from discrepancy.result.sensitivity import blind_spots, detection_limits
from discrepancy.result.signature import signature
from discrepancy.rig import Rig
from discrepancy.team.gain import Gain, Response
from estimator.arrays import Array

MOST_PLACES = 8


def diagnosis_to_dict(
    diagnosis: Diagnosis,
    rig: Rig,
    words: Words,
    estimates: Mapping[str, Any] | None = None,
    rollouts: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The diagnosis as documented above.

    Args:
        diagnosis: the verdict.
        rig: what was diagnosed.
        words: of the rig.
        estimates: what the rig estimates ``before`` and ``after``, plain JSON values; ``errors`` may lie beside them.
        rollouts: what rollouts said, plain JSON values.
    """
    explanation = diagnosis.explanation
    nominal = Fit.of(explanation.nothing.problem.as_whitened, background=False)
    gain = None if diagnosis.gain is None else _gain(diagnosis.gain, rig, words)
    if estimates is not None:
        gain = gain or {
            "held_out": {"before": None, "after": None, "as_found": None},
            "units": {},
            "noise": {},
            "removed": None,
            "validated": False,
            "trials": [],
        }
        gain["estimates"] = {name: estimates[name] for name in ("before", "after")}
        if "errors" in estimates:
            gain["errors"] = estimates["errors"]
    values: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "machine": "team",
        "finished": True,
        "recordings": list(rig.trials),
        "verdict": diagnosis.verdict,
        "prior_odds": explanation.problem.odds,
        "causes": [
            _cause(found, alternatives, rig, words, diagnosis.located)
            for found, alternatives in zip(diagnosis.causes, diagnosis.alternatives, strict=True)
        ],
        "places": places_to_dict(diagnosis.located, MOST_PLACES),
        "suspected": [_suspected(found, rig, words) for found in explanation.suspected],
        "scatter": [scatter_to_dict(item) for item in explanation.scatter],
        "foretold": None if explanation.foretold is None else asdict(explanation.foretold),
        "evidence": evidence_list(explanation),
        "gain": gain,
        "not_simulated": diagnosis.not_simulated,
        "rollouts": rollouts,
        "undecidable": [*rig.undecidable(), *blind_spots(explanation)],
        "detection_limits": detection_limits(explanation),
        "residual": {
            "chi2_per_n": explanation.after / explanation.samples,
            "signature": plain(signature(rig, _remaining(rig, explanation.fit))),
            "chi2_per_n_tolerated": explanation.before / explanation.samples,
            "unlisted_nats": float(explanation.unlisted_nats),
            "nominal": {
                "chi2_per_n": nominal.misfit / explanation.samples,
                "signature": plain(signature(rig, _remaining(rig, nominal))),
            },
        },
        "notes": list(diagnosis.notes),
    }
    return values | {"remains": remains(values)}


def _remaining(rig: Rig, fit: Fit) -> list[Array]:
    return [fit.remaining(t) for t in range(len(rig.trials))]


def _cause(
    found: Found, alternatives: Sequence[Alternative], rig: Rig, words: Words, located: Sequence[Located]
) -> dict[str, Any]:
    candidate, instead = found.candidate, _Instead.of(found, alternatives)
    values, se = rig.effect_parameters(candidate, found.values, found.covariance)
    return {
        **place_of(candidate),
        "sentence": words.describe(candidate, values, se),
        "parameters": {
            name: {"value": float(value), "se": _finite(se.get(name))} for name, value in values.items()
        },
        "explained": {"in_sample": found.in_sample, "held_out": found.held_out},
        "probability": float(found.probability),
        "over_nothing": _finite(found.over_nothing),
        "share_left": float(found.share_left),
        "instead": {"nothing": instead.nothing, "unlisted": instead.unlisted},
        "folds": [float(gain) for gain in found.folds],
        "shape": plain(dict(candidate.shape)),
        "law": _law(candidate, found.values, rig, located) if isinstance(candidate, LawCandidate) else None,
        "separate": words.separate(candidate),
        "members": [],
        "alternatives": [
            {
                **place_of(rival.candidate),
                "probability": probability,
                "evidence_gap": float(rival.evidence_gap),
                "chi2_per_n": _finite(rival.chi2_per_n),
                "ambiguous": bool(rival.ambiguous),
                "separate": words.separate(rival.candidate),
            }
            for rival, probability in zip(alternatives, instead.rivals, strict=True)
        ],
    }


def _law(candidate: LawCandidate, values: Array, rig: Rig, located: Sequence[Located]) -> dict[str, Any]:
    units = units_of(candidate, physical(candidate, values, candidate.shape))
    return {
        **law_to_dict(candidate),
        "units": units,
        "traces": traces_of(candidate, values, located, rig.bench),
    }


def _suspected(found: Found, rig: Rig, words: Words) -> dict[str, Any]:
    values, se = rig.effect_parameters(found.candidate, found.values, found.covariance)
    return {
        **place_of(found.candidate),
        "at": at_of(found.candidate),
        "sentence": words.describe(found.candidate, values, se),
        "probability": float(found.probability),
        "over_nothing": _finite(found.over_nothing),
    }


@dataclass(frozen=True)
class _Instead:
    """Probabilities that add up to 1 with that of the cause.

    Attributes:
        rivals: of every listed rival, in the order of ``Found.rivals``.
        nothing: that there is nothing in its place.
        unlisted: that something is there that is not in the catalogue, and looks like it.
    """

    rivals: tuple[float, ...]
    nothing: float
    unlisted: float

    @classmethod
    def of(cls, found: Found, alternatives: Sequence[Alternative]) -> "_Instead":
        """What ``engine.probability`` weighs against a cause: what is so many nats less likely, by so much less."""
        apart = parted([*map(decided_gap, alternatives)], found.doubt, found.over_nothing)
        gaps = np.append(apart, found.over_nothing)
        listed = found.probability * np.exp(-np.clip(gaps, -50.0, 700.0))
        rest = 1.0 - found.probability - float(listed.sum())
        return cls(tuple(map(float, listed[:-1])), float(listed[-1]), max(rest, 0.0))


def _gain(gain: Gain, rig: Rig, words: Words) -> dict[str, Any]:
    channels = list(next((a.rms for a, _ in gain.pairs), {}))
    removed = gain.removed()
    names = [rig.trials[t] for t in rig.resimulated]
    both = zip(names, gain.before, gain.after, strict=True)
    before, after = [a for a, _ in gain.pairs], [b for _, b in gain.pairs]
    told = {"before": before, "after": after, "as_found": gain.as_found}
    return {
        "held_out": {name: _mean(each) for name, each in told.items()},
        "units": {name: words.unit(name) for name in channels},
        "noise": {f"{name}_rms": _noise(rig, name) for name in channels},
        "removed": None
        if removed is None
        else {"share": removed[0], "interval": [_finite(removed[1]), _finite(removed[2])]},
        "validated": gain.held_out,
        "trials": [{"name": name, "before": _response(a), "after": _response(b)} for name, a, b in both],
    }


def _noise(rig: Rig, channel: str) -> float:
    squares = [np.mean(rig.response_scale(t)[channel][0] ** 2) for t in range(len(rig.trials))]
    return float(np.sqrt(np.mean(squares)))


def _response(response: Response | None) -> dict[str, float] | None:
    if response is None:
        return None
    return (
        {f"{name}_nrmse": float(v) for name, v in response.nrmse.items()}
        | {f"{name}_rms": float(v) for name, v in response.rms.items()}
        | {"chi2_per_n": float(response.chi2_per_n)}
    )


def _mean(responses: Sequence[Response | None]) -> dict[str, float] | None:
    """That of some trials is not to be held against that of all."""
    each = [values for values in map(_response, responses) if values is not None]
    whole = each and len(each) == len(responses)
    return {key: float(np.mean([values[key] for values in each])) for key in each[0]} if whole else None


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
