"""Which recording the others do not fit with: calibrations without it, and of it alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.calibrate.calibration import Calibration
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.fit import fit
from estimator.calibrate.prior import Prior
from estimator.calibrate.problem import KnownMass, Trial
from estimator.calibrate.unknowns import Unknowns
from estimator.errors import InputError


@dataclass(frozen=True, eq=False)
class Given:
    """All that a calibration is made from; as ``fit`` takes it."""

    trials: Sequence[Trial]
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
