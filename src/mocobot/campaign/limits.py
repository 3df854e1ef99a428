"""Detection limits of a background: those that the diagnosis of its clean set states, and those of pushes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate, Transient
from discrepancy.evidence.posterior import Posterior
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnose import TeamOutcome
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array

GAIN = 38.0
"""Gain of chi-square of what is about noticed nine times in ten."""
PUSH_S = 1.0
"""How long a push lasts whose limit is told; others need more or less force."""
EVERY_S = 5.0
"""From one push to the next of those whose limits are taken the median of."""
FORCE = {"force_x_N", "force_y_N", "force_z_N"}
TETHER = FORCE | {"stiffness_N_per_m"}
NEEDED = {"slosh": {"mass_kg"}, "tether": TETHER, "payload_tether": TETHER, "payload_mass": {"mass_kg"}}
"""Parameters without whose limits an effect cannot be drawn."""

Json = dict[str, Any]


def pushes(rig: TeamRig, tolerance: Mapping[str, float]) -> list[Candidate]:
    """A push of a second every five seconds of all trials.

    Args:
        rig: of the trials.
        tolerance: of a push, by parameter.
    """
    spans = [(t, linear.reduction.time) for t, linear in enumerate(rig.linear)]
    return [
        CAUSES["push"].event(tolerance, Transient(trial, float(start), PUSH_S))
        for trial, time in spans
        for start in np.arange(time[0] + 1.0, time[-1] - PUSH_S, EVERY_S)
    ]


def push_limits(outcome: TeamOutcome, tolerance: Mapping[str, float]) -> list[Json]:
    """Detection limit of a push of a second in every trial, beyond its tolerance, the median over its instants.

    Returns:
        {trial, parameters: {name: size or None}} for every trial that is long enough; trials count from 1.
    """
    problem, p = outcome.problem, outcome.state.posterior
    cells, events = problem.cells, pushes(outcome.rig, tolerance)
    count, found = cells.count, dict[int, list[Array]]()
    placed = [problem.place(problem.group_of(event, 0.0)) for event in events]
    wider = Posterior(cells, np.append(p.prior, np.zeros(cells.count - len(p.prior))), p.variance)
    for event, group in zip(events, placed, strict=True):
        assert event.transient is not None
        tolerated = [parameter.tolerance for parameter in event.parameters]
        size = np.sqrt(GAIN) * np.hypot(wider.errors_of(group.columns), tolerated)
        found.setdefault(event.transient.trial + 1, []).append(size)
    cells.truncate(count)
    names = [parameter.name for parameter in events[0].parameters] if events else []
    return [
        {"trial": trial, "parameters": dict(zip(names, _medians(values), strict=True))}
        for trial, values in sorted(found.items())
    ]


def _medians(values: Sequence[Array]) -> list[float | None]:
    return [float(m) if np.isfinite(m) else None for m in np.median(values, axis=0)]


@dataclass(frozen=True)
class MeasuredLimits:
    """Detection limits as a clean set's file has them.

    Attributes:
        places: {cause, robot, joint, parameters: {name: size or None}}, as a diagnosis states them.
        pushes: {trial, parameters}, as ``push_limits`` does.
    """

    places: Sequence[Json]
    pushes: Sequence[Json]

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """By parameter, of a cause at a place; empty where nothing shows it."""
        entries = self.pushes if cause == "push" else [e for e in self.places if e["cause"] == cause]
        here = (trial,) if cause == "push" else (robot, joint)
        keys = ("trial",) if cause == "push" else ("robot", "joint")
        for entry in entries:
            if tuple(entry[key] for key in keys) == here:
                return {name: size for name, size in entry["parameters"].items() if size is not None}
        return {}

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """The length that the limit is of, and the limit."""
        return CAUSES["slosh"].shapes[0]["length_m"], self.at("slosh")["mass_kg"]

    def where(self, cause: str, moving: Sequence[int]) -> list[tuple[int | None, int | None]]:
        """Robot and joint of all places at which a cause shows, so that it can be hidden there.

        Args:
            cause: its name.
            moving: trials (from 1) in which a push may act.
        """
        if cause == "push":
            told = [set(self.at(cause, trial=trial)) >= FORCE for trial in moving]
            return [(None, None)] if told and all(told) else []
        places = [(entry["robot"], entry["joint"]) for entry in self.places if entry["cause"] == cause]
        return [place for place in places if self._shows(cause, place)]

    def _shows(self, cause: str, place: tuple[int | None, int | None]) -> bool:
        seen = set(self.at(cause, *place))
        return bool(seen) and NEEDED.get(cause, set()) <= seen
