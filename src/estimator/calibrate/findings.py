"""Assess a calibration: misfits and their causes, held-out trials, shares of recordings, open questions.

The problem is nearly linear at its solution, so each alternative takes one solution of the normal equations. Only if
no alternative explains a misfit, the calibration is repeated without each recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import AT, COUNT, GROUPS
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibration import GRASPS, INERTIAL, MASSES
from estimator.calibrate.least_squares import Fit, Given, Quadratic, fit, normal_equations, solved
from estimator.calibrate.prior import Prior
from estimator.errors import InputError

UNKNOWN_MASSES = 0.05
"""Assumed relative error of arm masses that were not weighed."""
_SENSORS = (
    ("phi_zero", "the encoder of phi{entry}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("theta_zero", "the encoder of theta_{axis}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("tau_zero", "the torque zero of tau{entry}", "moved by {size:.2g} N m", 1.0),
)


class Change(NamedTuple):
    """A possible change in one recording (index from 0) relative to all others.

    ``what`` describes it; chi2 falls by ``drop`` for this number of ``unknowns``.
    """

    trial: int
    what: str
    drop: float
    unknowns: int


def findings(found: Fit, given: Given, names: Sequence[str]) -> list[str]:
    """Return sentences on data that the calibration does not explain; none for good recordings.

    Args:
        found: the calibration.
        given: its input.
        names: names of the recordings with a payload.
    """
    trials = found.point.trials
    odd = [k for k, trial in enumerate(trials) if trial.loops.misfits or trial.balance.misfits]
    if not odd and found.converged:
        return []
    if not odd:
        return [
            f"The calibration did not settle within {rules.MAX_STEPS} steps, so its numbers are not to be used: "
            f"{', '.join(names)} leave too much open. Add a recording of another motion."
        ]
    if found.converged:  # derivatives at another point do not predict the effect of a change
        worth = {change: _worth(found, change) for change in _changes(found, names)}
        enough = [change for change in worth if worth[change] > 0 and _suffices(found, change)]
        if enough:
            # A slip of theta_x also turns a grasp: take the simplest change that suffices.
            best = min(enough, key=lambda change: (change.unknowns, -worth[change]))
            rest = "the other recordings" if len(names) > 2 else "the other recording"
            return [f"{names[best.trial]} contradicts {rest}: {best.what}. Leave it out, or record it again."]
    return [_contradicting(given, names) or _unexplained(found, odd, names)]


def _unexplained(found: Fit, odd: Sequence[int], names: Sequence[str]) -> str:
    trials = found.point.trials
    worst = max(odd, key=lambda k: trials[k].all.c)
    parts = [
        f"{names[k]} ({trials[k].loops.ratio:.3g} in its loops, {trials[k].balance.ratio:.3g} in its balance)"
        for k in odd
    ]
    return (
        f"No calibration explains {'; '.join(parts)}: chi2/n is 1 where robots, payload and noise are all there is, "
        f"and {rules.MISFIT} at most. Something else acts on these robots, most in {names[worst]}; the numbers are not "
        "to be trusted before mocobot diagnose has named it."
    )


def _suffices(found: Fit, change: Change) -> bool:
    """Return whether a change explains the misfit, or almost all of a large one, which is not exactly linear."""
    whole = [trial.all for trial in found.point.trials]
    total, count = sum(part.c for part in whole), sum(part.count for part in whole)
    left = total - change.drop
    return left < rules.MISFIT * count or left - count < (1.0 - rules.SUFFICES) * (total - count)


def _worth(found: Fit, change: Change) -> float:
    """Return the drop in chi2 beyond the penalty for its free parameters (Schwarz's criterion)."""
    return change.drop - change.unknowns * np.log(found.point.trials[change.trial].all.count)


def _changes(found: Fit, names: Sequence[str]) -> list[Change]:
    """Return the candidate changes: every sensor's zero, the payload, and its grasps, each in one recording."""
    if len(names) < 2:
        return []
    out = []
    layout, trials = found.layout, found.point.trials
    first = [int(trial.all.index[layout.of_units.stop]) for trial in trials]  # first index of its payload
    for k, trial in enumerate(trials):
        for robot in range(layout.robots):
            for group, sensor, moved, scale in _SENSORS:
                for entry in range(3):
                    place = robot * COUNT + AT[group].start + entry
                    drop, size = _freed(found, trial.all, np.array([place]))
                    words = f"{sensor} of omnid{robot + 1} {moved}".format(
                        entry=entry + 1, axis="zyx"[entry], size=abs(float(size[0])) * scale
                    )
                    out.append(Change(k, words, drop, 1))
        if first.count(first[k]) > 1:
            own = trial.all.index[layout.of_units.stop : layout.of_units.stop + layout.per_payload]
            for places, words in (
                (own[-10:], "it looks like another payload"),
                (own, "it looks like another payload, held elsewhere"),
                (own[:-10], "the robots hold the payload elsewhere"),
            ):
                out.append(Change(k, words, _freed(found, trial.all, places)[0], len(places)))
    return out


def _freed(found: Fit, part: Quadratic, places: NDArray[np.intp]) -> tuple[float, Array]:
    """Free some unknowns in one recording and refit the rest: return the drop in chi2 and their changes."""
    own = np.searchsorted(part.index, places)
    H_ee, H_ex, g_e = part.H[np.ix_(own, own)], part.H[own], part.g[own]
    C = found.covariance[np.ix_(part.index, part.index)]
    S = H_ee - H_ex @ C @ H_ex.T
    scale = np.sqrt(np.maximum(np.diag(H_ee), 1e-300))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    told = values > 1e-9
    along = vectors[:, told].T @ (g_e / scale)
    size = -(vectors[:, told] @ (along / values[told])) / scale
    return float(np.sum(along**2 / values[told])), size


def _contradicting(given: Given, names: Sequence[str]) -> str | None:
    """Return a sentence on the recording without which the others fit one team of robots, or None."""
    every = range(len(names))
    if len(every) < 2:
        return None
    odd = [k for k in every if _fits(given, [other for other in every if other != k])]
    if not odd:
        return None
    if len(odd) > 1:
        listed = " and ".join(names[k] for k in odd)
        return (
            f"{listed} contradict each other: without either, what is left fits one team of robots. They are of other "
            "robots or of another payload, or something slipped between them; calibrate each apart."
        )
    rest = "the others fit" if len(every) > 2 else "the other fits"
    begin = f"{names[odd[0]]} contradicts the other recordings: {rest} one team of robots, and it fits"
    if _fits(given, odd):
        return f"{begin} another. It is of other robots, or of another payload. Leave it out."
    return f"{begin} none. Leave it out; mocobot diagnose may name what acts in it."


def _fits(given: Given, chosen: Sequence[int]) -> bool:
    """Return whether some of the trials, by index, fit one team of robots."""
    try:
        found = fit(given.only(chosen))
    except (InputError, np.linalg.LinAlgError):
        return False
    parts = [part for trial in found.point.trials for part in (trial.loops, trial.balance)]
    return found.converged and not any(part.misfits for part in parts)


def held_out(found: Fit) -> list[tuple[float, float] | None]:
    """Return chi2/n of loops and balance of every trial, predicted from the others; None if they do not suffice.

    The bases differ in every trial, so they are fitted to the predicted trial itself.
    """
    out: list[tuple[float, float] | None] = []
    layout, point = found.layout, found.point
    payload = [int(trial.all.index[layout.of_units.stop]) for trial in point.trials]
    for k, trial in enumerate(point.trials):
        if payload.count(payload[k]) < 2:
            out.append(None)
            continue
        own = np.r_[layout.of_trial(k)]
        others = [other.all for i, other in enumerate(point.trials) if i != k]
        H, g = normal_equations([*others, *point.alone, *point.known], layout.size)
        free = ~np.isin(np.arange(layout.size), own)
        kept = found.basis[free].any(axis=0)
        columns, prior, z = found.basis[:, kept], found.prior[kept], point.z[kept]
        dz, _ = solved(columns.T @ H @ columns + np.diag(prior), columns.T @ g + prior * z)
        dx = columns @ dz
        at = np.flatnonzero(np.isin(trial.all.index, own))
        score = trial.all.g + trial.all.H @ dx[trial.all.index]
        if len(at):
            dx[own] = solved(trial.all.H[np.ix_(at, at)], score[at])[0]
        loops = trial.loops.at(dx) / max(1, trial.loops.count)
        out.append((loops, trial.balance.at(dx) / trial.balance.count))
    return out


def undecided(found: Fit, prior: Prior, scale_sd: float, *, alone: bool, single: list[str]) -> list[str]:
    """Return sentences on what the recordings do not determine.

    Args:
        found: the calibration.
        prior: prior of the robots.
        scale_sd: standard deviation of the held common spring scale; 0 if it is free.
        alone: whether unloaded arms were recorded.
        single: names of payloads with one recording.
    """
    out = []
    layout, carried = found.layout, found.point.unknowns.carried
    if scale_sd:
        places = [layout.of_inertia(k).start for k in range(layout.payloads)]
        masses = [
            np.sqrt(found.covariance[at, at]) / shared.pi[0]
            for at, shared in zip(places, carried, strict=True)
        ]
        out.append(
            "The common scale of all springs is held at its design value, for a carry tells it from the mass by the "
            f"arms' own weight alone: all masses and inertias may be off together by {100 * scale_sd:.2g} % (one "
            f"standard error). One weighed payload (--known-mass) brings that to {100 * min(masses):.1g} %."
        )
    if prior.encoder_zero_rad:
        reach = max(float(np.max(np.linalg.norm(shared.grasps.p_1i, axis=1))) for shared in carried)
        degrees = np.rad2deg(prior.encoder_zero_rad)
        out.append(
            "The zeros of the last gimbal axes (theta_x) only turn the grasp frames, so frames are those that the "
            f"encoders define. Frames drawn at the flanges may be turned against them by {degrees:.2g} deg about their "
            "x axes (one standard error), which moves positions in {1} by up to "
            f"{1e3 * reach * prior.encoder_zero_rad:.2g} mm. Flanges known to be parallel (--parallel-flanges), or an "
            "index mark at each, decide them."
        )
    if not prior.arm_mass_ratio and not alone:
        share = max(_by_masses(found, k) for k in range(layout.payloads))
        out.append(
            "The arms' masses are taken as designed but for one common factor. Where each is known to "
            f"{100 * UNKNOWN_MASSES:.0f} % only, a payload's mass is off by {100 * share:.2g} % besides (one standard "
            "error): free them (--arm-masses), best with a recording of the unloaded arms (--free)."
        )
    out += [
        f"{name}: with one recording none can be left out, so nothing shows how well the calibration predicts "
        "another; record a second motion of the same payload."
        for name in single
    ]
    return out


def _by_masses(found: Fit, payload: int) -> float:
    """Return the relative error of a payload's mass if each arm mass has an error of ``UNKNOWN_MASSES``."""
    layout, point = found.layout, found.point
    parts = [*(trial.all for trial in point.trials), *point.alone, *point.known]
    H, _ = normal_equations(parts, layout.size)
    at = layout.of_inertia(payload).start
    by_mass = -(found.covariance[at] @ H[:, layout.unit_indices(MASSES)])
    return float(UNKNOWN_MASSES * np.linalg.norm(by_mass) / point.unknowns.carried[payload].pi[0])


def shares(found: Fit) -> list[dict[str, float]]:
    """Return each recording's mean share in the information on each kind of unknown.

    With whitened rows, the covariance C of all unknowns is the sum of C H_k C over recordings, known weights and the
    prior, with H_k their information. The share of recording k in unknown j is (C H_k C)_jj / C_jj. The rest up to 1
    belongs to the prior and the known weights.

    Returns:
        Shares by the names of ``GROUPS``, ``GRASPS`` and ``INERTIAL``; recordings with a payload first, then the
        others. Held kinds are omitted.
    """
    layout, point, C = found.layout, found.point, found.covariance
    variance = np.diag(C)
    kinds = {group.name: layout.unit_indices(np.r_[AT[group.name]]) for group in GROUPS}
    carried = np.arange(layout.of_payload(0).start, layout.of_payload(layout.payloads).start)
    inertial = (carried - layout.of_units.stop) % layout.per_payload >= layout.per_payload - 10
    kinds |= {GRASPS: carried[~inertial], INERTIAL: carried[inertial]}
    kinds = {kind: at[variance[at] > 1e-12 * np.max(variance[at], initial=0.0)] for kind, at in kinds.items()}
    out = []
    for part in (*(trial.all for trial in point.trials), *point.alone):
        columns = C[:, part.index]
        weight = np.einsum("jk,jk->j", columns @ part.H, columns)
        weight /= np.maximum(variance, np.finfo(float).tiny)
        out.append({kind: float(np.mean(weight[at])) for kind, at in kinds.items() if len(at)})
    return out
