"""x"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import AT, GROUPS
from estimator.arrays import Array
from estimator.calibrate.calibration import Calibration, Prior
from estimator.calibrate.equations import AloneEquations
from estimator.calibrate.least_squares import CarriedTrial, Fit, KnownMass, Quadratic, Unknowns, fit
from estimator.errors import InputError


@dataclass(frozen=True, eq=False)
class Given:
    """All that a calibration is made from; as ``fit`` takes it."""

    trials: Sequence[CarriedTrial]
    start: Unknowns
    prior: Prior
    alone: Sequence[AloneEquations] = ()
    known_mass: Sequence[KnownMass] = ()
    robots: Calibration | None = None

    def fits(self, chosen: Sequence[int]) -> bool:
        """Whether some of the trials, by index, fit one team of robots."""
        carried = sorted({self.trials[k].payload for k in chosen})
        start = replace(
            self.start,
            carried=tuple(self.start.carried[payload] for payload in carried),
            bases=tuple(self.start.bases[k] for k in chosen),
        )
        trials = [replace(self.trials[k], payload=carried.index(self.trials[k].payload)) for k in chosen]
        known = [
            replace(one, payload=carried.index(one.payload))
            for one in self.known_mass
            if one.payload in carried
        ]
        try:
            found = fit(trials, start, self.prior, self.alone, known, self.robots)
        except (InputError, np.linalg.LinAlgError):
            return False
        parts = [part for trial in found.trials for part in (trial.loops, trial.balance)]
        return found.converged and not any(part.misfits for part in parts)


def contradicting(given: Given, names: Sequence[str]) -> str | None:
    """A sentence on the recording without which all others fit one team of robots; None if there is none.

    Args:
        given: recordings that do not fit one team.
        names: of those with a payload.
    """
    count = len(names)
    if count < 2:
        return None
    every = range(count)
    odd = [k for k in every if given.fits([other for other in every if other != k])]
    if not odd:
        return None
    if len(odd) > 1:
        listed = " and ".join(names[k] for k in odd)
        return (
            f"{listed} contradict each other: without either, what is left fits one team of robots. They are of other "
            "robots or of another payload, or something slipped between them; calibrate each apart."
        )
    name, rest = names[odd[0]], "the others fit" if count > 2 else "the other fits"
    if given.fits(odd):
        return (
            f"{name} contradicts the other recordings: {rest} one team of robots, and it fits another. It is of other "
            "robots, or of another payload. Leave it out."
        )
    return (
        f"{name} contradicts the other recordings: {rest} one team of robots, and it fits none. Leave it out; mocobot "
        "diagnose may name what acts in it."
    )


GRASPS, INERTIAL = "grasps", "inertial_parameters"


def shares(found: Fit) -> list[dict[str, float]]:
    """Mean share of every recording in each kind of unknown: by the names of ``GROUPS``, "grasps" and
    "inertial_parameters"; those with a payload first, then the others. Kinds that are held are left out.
    """
    variance = np.diag(found.covariance)
    kinds = {
        kind: at[variance[at] > 1e-12 * np.max(variance[at], initial=0.0)]
        for kind, at in _kinds(found).items()
    }
    parts = [*(trial.all for trial in found.trials), *found.alone]
    weights = [
        _weights(part, found.covariance) / np.maximum(variance, np.finfo(float).tiny) for part in parts
    ]
    return [
        {kind: float(np.mean(weight[at])) for kind, at in kinds.items() if len(at) and variance[at].any()}
        for weight in weights
    ]


def _kinds(found: Fit) -> dict[str, NDArray[np.intp]]:
    layout = found.layout
    out = {group.name: layout.unit_indices(np.r_[AT[group.name]]) for group in GROUPS}
    payloads = range(layout.payloads)
    grasps = [k for p in payloads for k in range(layout.of_payload(p).start, layout.of_inertia(p).start)]
    inertial = [k for p in payloads for k in range(layout.of_inertia(p).start, layout.of_inertia(p).stop)]
    return out | {GRASPS: np.array(grasps, dtype=np.intp), INERTIAL: np.array(inertial, dtype=np.intp)}


def _weights(part: Quadratic, covariance: Array) -> Array:
    """Diagonal of C H C."""
    columns = covariance[:, part.index]
    return np.einsum("jk,jk->j", columns @ part.H, columns)
