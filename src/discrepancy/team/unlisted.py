"""Errors that no cause of the tables makes: smooth functions of one signal, at one place of a team."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import rankdata

from discrepancy.evidence.posterior import Group
from discrepancy.team.laws.directions import directions_at
from discrepancy.team.laws.place import Place
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variable import TIME, Variable
from discrepancy.team.laws.variables import joint_variable, signals_of
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array

TERMS = 7
"""Cosines of a function: periods down to a quarter of the signal's range."""
SIZES = {
    "tau reading": 5e-3, "phi reading": 1e-4, "theta reading": 1e-4, "gimbal torque": 2e-3, "base position": 1e-5,
    "grasp position": 1e-5, "force on payload": 0.02, "payload mass": 0.01, "payload centre": 3e-3,
    "payload spin": 0.01,
}  # fmt: skip
"""Typical small errors of a place, in its unit: the tolerances of the listed causes there."""
SLAB = 16.0
"""Largest such error that is expected, in these."""
UNLISTED_NATS = 5.0
"""Log odds of a listed cause over something that no table lists."""
OPEN_NATS = 30.0
"""What the noise must be worth beyond that of the sensors, before something unlisted is looked for."""
LIKELIEST = 8
"""Places and signals whose exact linear gain is computed."""


@dataclass(frozen=True, eq=False)
class Law:
    """An error at a place that is a function of a signal.

    Attributes:
        place, variable: which.
        component: of the place.
    """

    place: Place
    component: int
    variable: Variable

    @property
    def group(self) -> Group:
        """The law as a group of the engine, without columns."""
        own = self.place
        where = own.title.replace("{", "").replace("}", "")
        where += f" {own.joint}" if own.joint else ""
        where += f" of robot {own.robot}" if own.robot else ""
        axis = own.axes[self.component]
        falling = 1.0 / (1.0 + np.arange(TERMS))
        sizes = SLAB * SIZES[own.name] * falling / np.sqrt(np.sum(falling**2))
        return Group("unlisted", f"{where} {axis}".strip(), (), tuple(sizes.tolist()), -UNLISTED_NATS,
                     ((self.variable.name, float(self.component)),), late=True)  # fmt: skip


@dataclass(eq=False)
class Laws:
    """All that may be wrong of a team's places as functions of their own signals.

    Attributes:
        linear: trials.
        laws: by the identity of their groups.
    """

    linear: Sequence[TrialLinear]
    laws: dict[object, Law] = field(default_factory=dict)
    _signals: list[dict[str, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for place in places_of(self.linear[0].robots):
            for component in range(len(place.targets)):
                for variable in self._variables(place):
                    law = Law(place, component, variable)
                    self.laws[law.group.identity] = law

    def _variables(self, place: Place) -> Iterator[Variable]:
        yield from (v for v in place.own if not v.parts)
        yield TIME
        if place.name == "tau reading" and place.robot and place.joint:
            yield from (joint_variable("tau", place.robot, j) for j in (1, 2, 3) if j != place.joint)

    def basis(self, variable: Variable) -> list[Array]:
        """Cosines of the rank of a signal, shape (Q, TERMS) a trial."""
        if not self._signals:
            self._signals += [signals_of(t) for t in self.linear]
        each = [s[variable.name] for s in self._signals]
        rank = (rankdata(np.concatenate(each)) - 0.5) / sum(map(len, each))
        parts = np.split(rank, np.cumsum([len(x) for x in each])[:-1])
        return [np.cos(np.pi * np.outer(u, 1.0 + np.arange(TERMS))) for u in parts]

    def columns(self, law: Law) -> list[Array]:
        """What the terms of a law add to the residual, shape (n, C, TERMS) a trial."""
        out = []
        for linear, errors in zip(self.linear, self.basis(law.variable), strict=True):
            D = directions_at(linear, law.place)[:, law.component]  # (n, parts, C)
            parts = linear.signals.with_rates(errors)[: D.shape[1]]
            rows = np.stack([linear.reduction(part) for part in parts], axis=1)
            out.append(np.einsum("npc,npk->nck", D, rows))
        return out

    def proposed(self, left: Sequence[Array], white: Callable[[list[Array]], list[Array]]) -> list[Group]:
        """The likeliest laws by what rows leave along the direction of their place.

        Args:
            left: rows over their variance, shape (n, C) a trial.
            white: whitens rows (n, C, 1) one by one.
        """
        directions: dict[tuple[object, int], list[Array]] = {}
        bases: dict[str, list[Array]] = {}
        found = []
        for law in self.laws.values():
            key = law.place.key, law.component
            if key not in directions:
                each = [directions_at(t, law.place)[:, law.component, 0] for t in self.linear]
                directions[key] = white([d[..., None] for d in each])
            if law.variable.name not in bases:
                pairs = zip(self.linear, self.basis(law.variable), strict=True)
                bases[law.variable.name] = [b[t.reduction.sample] for t, b in pairs]
            slab = np.array(law.group.slab)
            A, b = np.eye(TERMS), np.zeros(TERMS)
            for D, z, f in zip(directions[key], left, bases[law.variable.name], strict=True):
                d, g = D[..., 0], (f - f.mean(axis=0)) * slab
                A += (g * np.sum(d**2, axis=1)[:, None]).T @ g
                b += g.T @ np.sum(d * z, axis=1)
            found.append((0.5 * float(b @ np.linalg.solve(A, b) - np.linalg.slogdet(A)[1]), law))
        best = sorted(found, key=lambda pair: -pair[0])[:LIKELIEST]
        return [law.group for gain, law in best if gain > 0.0]
