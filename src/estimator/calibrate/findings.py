"""What is wrong with the recordings of a calibration: which one stands out, and what would explain it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.fit import Fit
from estimator.calibrate.left_out import Given, contradicting
from estimator.calibrate.quadratic import Quadratic

_SENSORS = (
    ("phi_zero", "the encoder of phi{entry}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("theta_zero", "the encoder of theta_{axis}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("tau_zero", "the torque zero of tau{entry}", "moved by {size:.2g} N m", 1.0),
)


class Change(NamedTuple):
    """Something that may have been otherwise in one recording than in all others.

    Attributes:
        trial: which one, from 0.
        what: in words.
        drop: by which chi2 falls.
        unknowns: how many it takes.
    """

    trial: int
    what: str
    drop: float
    unknowns: int


def findings(fit: Fit, given: Given, names: Sequence[str]) -> list[str]:
    """Sentences on what no calibration explains; none on good recordings.

    Args:
        fit: the calibration.
        given: what it was made from.
        names: of the recordings with a payload.
    """
    odd = [k for k, trial in enumerate(fit.trials) if trial.loops.misfits or trial.balance.misfits]
    if not odd:
        return [] if fit.converged else [_unsettled(names)]
    if fit.converged:  # elsewhere, derivatives say nothing of what would explain it
        enough = [c for c in _changes(fit, names) if _worth(fit, c) > 0 and _suffices(fit, c)]
        if enough:
            # A slip of a last gimbal turns a grasp, too: of what is enough, the simplest.
            best = min(enough, key=lambda change: (change.unknowns, -_worth(fit, change)))
            rest = "the other recordings" if len(names) > 2 else "the other recording"
            return [f"{names[best.trial]} contradicts {rest}: {best.what}. Leave it out, or record it again."]
    sentence = contradicting(given, names)
    return [sentence or _unexplained(fit, odd, names)]


def _unsettled(names: Sequence[str]) -> str:
    return (
        f"The calibration did not settle within {rules.MAX_STEPS} steps, so its numbers are not to be used: "
        f"{', '.join(names)} leave too much open. Add a recording of another motion."
    )


def _unexplained(fit: Fit, odd: Sequence[int], names: Sequence[str]) -> str:
    worst = max(odd, key=lambda k: fit.trials[k].all.c)
    parts = []
    for k in odd:
        loops, balance = fit.trials[k].loops.ratio, fit.trials[k].balance.ratio
        parts.append(f"{names[k]} ({loops:.3g} in its loops, {balance:.3g} in its balance)")
    return (
        f"No calibration explains {'; '.join(parts)}: chi2/n is 1 where robots, payload and noise are all there is, "
        f"and {rules.MISFIT} at most. Something else acts on these robots, most in {names[worst]}; the numbers are not "
        "to be trusted before mocobot diagnose has named it."
    )


def _suffices(fit: Fit, change: Change) -> bool:
    """Whether nothing would be left, or next to nothing of much: what is large is not quite linear."""
    total, count = sum(trial.all.c for trial in fit.trials), sum(trial.all.count for trial in fit.trials)
    left = total - change.drop
    return left < rules.MISFIT * count or left - count < (1.0 - rules.SUFFICES) * (total - count)


def _worth(fit: Fit, change: Change) -> float:
    """Drop in chi2 beyond what as many free numbers buy (Schwarz)."""
    return change.drop - change.unknowns * np.log(fit.trials[change.trial].all.count)


def _changes(fit: Fit, names: Sequence[str]) -> list[Change]:
    """Every sensor's zero, the payload and its grasps, each otherwise in one recording."""
    if len(names) < 2:
        return []
    out = []
    layout = fit.layout
    for k, trial in enumerate(fit.trials):
        for robot in range(layout.robots):
            for group, sensor, moved, scale in _SENSORS:
                for entry in range(3):
                    place = robot * COUNT + AT[group].start + entry
                    drop, size = _freed(fit, trial.all, np.array([place]))
                    words = f"{sensor} of omnid{robot + 1} {moved}".format(
                        entry=entry + 1, axis="zyx"[entry], size=abs(float(size[0])) * scale
                    )
                    out.append(Change(k, words, drop, 1))
        own = trial.all.index[layout.of_units.stop : layout.of_units.stop + layout.per_payload]
        grasps, inertia = own[:-10], own[-10:]
        payload = [i for i, other in enumerate(fit.trials) if other.all.index[layout.of_units.stop] == own[0]]
        if len(payload) > 1:
            out.append(Change(k, "it looks like another payload", _freed(fit, trial.all, inertia)[0], 10))
            drop = _freed(fit, trial.all, own)[0]
            out.append(Change(k, "it looks like another payload, held elsewhere", drop, len(own)))
            drop = _freed(fit, trial.all, grasps)[0]
            out.append(Change(k, "the robots hold the payload elsewhere", drop, len(grasps)))
    return out


def _freed(fit: Fit, part: Quadratic, places: NDArray[np.intp]) -> tuple[float, Array]:
    """Drop in chi2 if unknowns were others in one recording and the rest refitted, and by how much they would be."""
    own = np.searchsorted(part.index, places)
    H_ee, H_ex, g_e = part.H[np.ix_(own, own)], part.H[own], part.g[own]
    C = fit.covariance[np.ix_(part.index, part.index)]
    S = H_ee - H_ex @ C @ H_ex.T
    scale = np.sqrt(np.maximum(np.diag(H_ee), 1e-300))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    told = values > 1e-9
    along = vectors[:, told].T @ (g_e / scale)
    size = -(vectors[:, told] @ (along / values[told])) / scale
    return float(np.sum(along**2 / values[told])), size
