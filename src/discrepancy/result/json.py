"""JSON form of a diagnosis: plain types, no NaN, units in the keys; null is what could not be had.

format, version     "mocobot-diagnosis", 3; version 2 has no ``machine``, ``finished`` and ``members``
machine             "team", or "joints" of one robot of hinges and slides. A verdict of ``discrepancy.evidence`` on it
                    (``discrepancy.result.told``) has ``told``, ``event``, ``at``, ``reference`` and a limit's ``place``
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
    folds                          nats by which every trial is likelier with it, foretold by the others; of a team
                                   beside everything that is off within its tolerance
    law                            of what no catalogue lists {place, unit, targets, function, of, times, numbers,
                                   formula, units of the parameters}: an error at ``targets`` that is a function of
                                   ``of``, times the signal ``times`` if there is one; ``function`` names its terms
                                   (``formulas.terms``), ``spline`` where no formula says the curve. ``traces``: by
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
(``mocobot.results``).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np


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
