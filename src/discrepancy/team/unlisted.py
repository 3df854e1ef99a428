"""Laws of a team that no table lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from discrepancy.evidence.posterior import Group
from discrepancy.formulas.formula import Curve, Kind, Piece, formula_of
from discrepancy.formulas.law import Law, Of, traces
from discrepancy.team.laws import TIME, Place, Variable, directions_at, joint_variable, places_of, signals_of
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
OPEN_NATS = 150.0
"""What the noise must be worth beyond the sensors' before unlisted laws are sought: clean teams leave up to 110."""
LIKELIEST = 8
"""Places and signals whose exact linear gain is computed."""
KINDS: dict[str, Kind] = {"angle": "angle", "time": "time", "travel": "way", "position": "way"}
"""Signals of which something may come again."""


OWN_CONSTANT = ("gimbal torque", "force on payload", "payload spin")
"""Places where no listed cause is a constant."""
HUM_HZ = (0.3, 6.0)
"""Frequencies of a hum: slower it is a function of time, and rows come 12.5 times a second."""


@dataclass(frozen=True, eq=False)
class Unlisted:
    """An error at a place that is a function of a signal.

    Attributes:
        place, variable: which.
        component: of the place.
        times: a signal that multiplies it, or None.
        terms: cosines of the function.
        hz: frequency, of a hum.
        among: how many laws it is one of that are as likely.
    """

    place: Place
    component: int
    variable: Variable
    times: Variable | None = None
    terms: int = TERMS
    hz: float | None = None
    among: int = 1

    @property
    def where(self) -> str:
        """The place in words."""
        own = self.place
        where = own.title.replace("{", "").replace("}", "")
        where += f" {own.joint}" if own.joint else ""
        where += f" of robot {own.robot}" if own.robot else ""
        return f"{where} {own.axes[self.component]}".strip()

    @property
    def first(self) -> int:
        """Number of the first cosine: a constant is one where nothing listed is."""
        return 0 if self.place.name in OWN_CONSTANT and self.hz is None else 1

    @property
    def group(self) -> Group:
        """The law as a group of the engine, without columns."""
        k = np.append(np.arange(self.first, self.terms + 1.0), 1.0) if self.hz is None else np.zeros(2)
        falling = 1.0 / (1.0 + k)
        sizes = SLAB * SIZES[self.place.name] * falling / np.sqrt(np.sum(falling**2))
        shape = [(self.variable.name, float(self.component))]
        shape += [(f"times {self.times.name}", 1.0)] if self.times else []
        shape += [("terms", float(self.terms))] if self.terms != TERMS else []
        shape += [("hz", self.hz)] if self.hz is not None else []
        odds = -UNLISTED_NATS - math.log(self.among)
        return Group("unlisted", self.where, (), tuple(sizes.tolist()), odds, tuple(shape), late=True)


@dataclass(eq=False)
class Laws:
    """All that may be wrong of a team's places as functions of their own signals.

    Attributes:
        linear: trials.
        laws: by the identity of their groups.
    """

    linear: Sequence[TrialLinear]
    laws: dict[object, Unlisted] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for place in places_of(self.linear[0].robots):
            for component in range(len(place.targets)):
                for variable, times in self._variables(place):
                    law = Unlisted(place, component, variable, times)
                    self.laws[law.group.identity] = law

    def of(self, group: Group) -> Unlisted:
        """The law that is a group."""
        shape = dict(group.shape)
        plain = tuple(item for item in group.shape if item[0] not in ("terms", "hz"))
        law = self.laws[group.cause, group.place, plain]
        among = len(self._hums[0]) if "hz" in shape else 1
        return replace(law, terms=int(shape.get("terms", TERMS)), hz=shape.get("hz"), among=among)

    def _variables(self, place: Place) -> Iterator[tuple[Variable, Variable | None]]:
        yield from ((v, None) for v in place.own if not v.parts)
        yield TIME, None
        if place.name == "tau reading" and place.robot and place.joint:
            torques = [joint_variable("tau", place.robot, j) for j in (1, 2, 3)]
            yield from ((v, None) for j, v in enumerate(torques) if j + 1 != place.joint)
            yield TIME, torques[place.joint - 1]  # a scale that drifts

    @cached_property
    def _signals(self) -> list[dict[str, Array]]:
        return [signals_of(t) for t in self.linear]

    def _split(self, x: Array) -> list[Array]:
        return np.split(x, np.cumsum([len(s[TIME.name]) for s in self._signals])[:-1])

    def signal(self, variable: Variable) -> Array:
        """A signal in all trials one after another."""
        return np.concatenate([s[variable.name] for s in self._signals])

    def functions(self, law: Unlisted) -> Array:
        """Functions of the signal that a law is made of, shape (Q, k): cosines of its rank and itself, or a hum.

        Cosines alone have no slope at their ends, and what a joint's angle is off by acts through its rate, too.
        """
        x = self.signal(law.variable)
        if law.hz is not None:
            turned = 2.0 * np.pi * law.hz * x
            return np.stack([np.sin(turned), np.cos(turned)], axis=1)
        u = (rankdata(x) - 0.5) / len(x)
        waves = np.cos(np.pi * np.outer(u, np.arange(law.first, law.terms + 1.0)))
        return np.column_stack([waves, (x - x.mean()) / (math.sqrt(2.0) * np.std(x) + 1e-300)])

    def basis(self, law: Unlisted) -> list[Array]:
        """The law's terms, shape (Q, k) a trial."""
        f = self.functions(law)
        return self._split(f if law.times is None else f * self.signal(law.times)[:, None])

    def columns(self, law: Unlisted) -> list[Array]:
        """What the terms of a law add to the residual, shape (n, C, k) a trial."""
        out = []
        for linear, errors in zip(self.linear, self.basis(law), strict=True):
            D = directions_at(linear, law.place)[:, law.component]  # (n, parts, C)
            parts = linear.signals.with_rates(errors)[: D.shape[1]]
            rows = np.stack([linear.reduction(part) for part in parts], axis=1)
            out.append(np.einsum("npc,npk->nck", D, rows))
        return out

    def finer(self, group: Group) -> list[Group]:
        """The law with more cosines, or the hum a little faster and slower."""
        law = self.of(group)
        if law.hz is None:
            return [replace(law, terms=2 * TERMS).group] if law.terms == TERMS else []
        step = 0.125 / max(float(s[TIME.name][-1]) for s in self._signals)
        return [replace(law, hz=law.hz + d).group for d in (-step, step)]

    def proposed(self, left: Sequence[Array], white: Callable[[list[Array]], list[Array]]) -> list[Group]:
        """The likeliest laws by what rows leave along the direction of their place.

        Args:
            left: rows over their variance, shape (n, C) a trial.
            white: whitens rows (n, C, 1) one by one.
        """
        directions: dict[tuple[object, int], list[Array]] = {}
        bases: dict[object, list[Array]] = {}
        found = []
        for law in self.laws.values():
            key = law.place.key, law.component
            if key not in directions:
                each = [directions_at(t, law.place)[:, law.component, 0] for t in self.linear]
                directions[key] = white([d[..., None] for d in each])
                found.append(self._hum(law, directions[key], left))
            which = law.variable.name, law.times and law.times.name, law.first
            if which not in bases:
                pairs = zip(self.linear, self.basis(law), strict=True)
                bases[which] = [b[t.reduction.sample] for t, b in pairs]
            slab = np.array(law.group.slab)
            A, b = np.eye(len(slab)), np.zeros(len(slab))
            for D, z, f in zip(directions[key], left, bases[which], strict=True):
                d, g = D[..., 0], (f if law.first == 0 else f - f.mean(axis=0)) * slab
                A += (g * np.sum(d**2, axis=1)[:, None]).T @ g
                b += g.T @ np.sum(d * z, axis=1)
            found.append((0.5 * float(b @ np.linalg.solve(A, b) - np.linalg.slogdet(A)[1]), law))
        best = sorted(found, key=lambda pair: -pair[0])[:LIKELIEST]
        return [law.group for gain, law in best if gain > 0.0]

    @cached_property
    def _hums(self) -> tuple[Array, list[NDArray[np.complex64]]]:
        """Frequencies, four in each that a trial tells from the next, and waves of them at each trial's rows."""
        time = [s[TIME.name][t.reduction.sample] for s, t in zip(self._signals, self.linear, strict=True)]
        hz = np.arange(HUM_HZ[0], HUM_HZ[1], 0.25 / max(float(t[-1]) for t in time))
        return hz, [np.exp(-2j * np.pi * np.outer(hz, t)).astype(np.complex64) for t in time]

    def _hum(
        self, law: Unlisted, directions: Sequence[Array], left: Sequence[Array]
    ) -> tuple[float, Unlisted]:
        """The likeliest hum of a place, and its gain beside the odds of its frequency."""
        hz, waves = self._hums
        score, size = np.zeros(len(hz), dtype=complex), 0.0
        for E, D, z in zip(waves, directions, left, strict=True):
            score += E @ np.sum(D[..., 0] * z, axis=1)
            size += 0.5 * float(np.sum(D**2))
        gain = 0.5 * np.abs(score) ** 2 / max(size, 1e-300)
        best = int(np.argmax(gain))
        own = Unlisted(law.place, law.component, TIME, hz=float(hz[best]), among=len(hz))
        return float(gain[best]) - math.log(own.among) - math.log1p(own.group.slab[0] ** 2 * size), own

    def told(self, group: Group, mean: Array, covariance: Array, prior: Array) -> Law:
        """A law with its formula.

        Args:
            group: the law, in the model.
            mean, covariance: of its terms, shapes (k,) and (k, k).
            prior: variances with which these were fitted, shape (k,).
        """
        law = self.of(group)
        place, x, f = law.place, self.signal(law.variable), self.functions(law)
        kind = KINDS.get(law.variable.kind, "other")
        formula = formula_of(Curve(x, f, mean, covariance, prior, kind), law.hz)
        se = np.sqrt(np.maximum(np.einsum("qk,kl,ql->q", f, covariance, f), 0.0))
        w = np.ones(len(x)) if law.times is None else self.signal(law.times)
        time = [s[TIME.name] for s in self._signals]
        own = traces(time, x, w, f @ mean, se, formula, shift=law.first > 0)
        unit = place.units[law.component] if place.units else place.unit
        of, times = _of(law.variable), law.times and _of(law.times)
        return Law(
            place.name,
            place.robot,
            place.joint,
            place.targets[law.component],
            unit,
            of,
            times,
            formula,
            own,
        )

    def pieces(self, group: Group, law: Law, mean: Array) -> Iterator[Piece]:
        """A law, its terms (k,) as other data have them, as functions of one amplitude each, as simulators take it.

        Where the constant is not its own it has none: that is what zeros, biases and places are found beside.
        """
        own = self.of(group)
        x = self.signal(own.variable)
        formula = law.formula.through(x, self.functions(own), mean)
        yield from replace(law, formula=formula).pieces()
        if own.first and own.times is None:
            yield {
                "target": law.target,
                "function": "constant",
                "of": TIME.name,
                "amplitude": -float(np.mean(formula.at(x))),
            }


def _of(variable: Variable) -> Of:
    return Of(variable.name, variable.words, variable.symbol, variable.unit)
