"""Find wiring mistakes in a team's log: undo suspected mistakes one by one and report those that fit far better.

All robots hold one rigid payload, which predicts five disagreements to be zero. Each is divided by its own signal:

- rotation: angular velocities of the robots, rotated into {1} by the best-fitting R_1i;
- velocity: velocities of the origin of {1} from every robot, with the best-fitting p_1i;
- tilt: directions of gravity in {1} from every robot [rad];
- force, moment: total wrench in {1} against the ten best-fitting inertial parameters. The force residual is divided by
  the forces that the robots exert, the moment residual by those forces times their distance.

Without rotation about at least two axes, the grasps are not identifiable. Then only angular *speeds* and the total
vertical force, fitted by one mass, are compared.

Each disagreement is scaled by what a healthy robot may show: its tolerance (``TOLERANCES``) and the noise of its
channels. The misfit is the mean of the squares: about 1 for poorly calibrated robots, hundreds for swapped channels.

A misfit above ``SUSPICIOUS`` is suspicious. A mistake is reported if undoing it makes the misfit ``DECISIVE`` times
smaller. A smaller misfit may still hide a mistake of well calibrated robots; then the factor must be ``OVERWHELMING``.
Several mistakes are found greedily, the most helpful first. Finally each is put back alone, and dropped if it hardly
matters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import Arms, design_of
from estimator.arrays import Array
from estimator.so3 import cross
from estimator.statistics import rms
from mocobot_inspect.grasps import (
    FARTHEST_M,
    Body,
    Fault,
    Grasp,
    arm_motion,
    gimbal_motion,
    grasp_motion,
    rigid_body,
)
from mocobot_inspect.mistakes import SUSPICIONS, Mistake, refined, wrong_zero
from mocobot_inspect.signals import Signals

TOLERANCES = {
    "rotation": 0.01, "velocity": 0.03, "tilt": 0.02, "force": 0.03, "moment": 0.025, "angular speed": 0.01,
    "lift": 0.03,
}  # fmt: skip
"""Disagreement of robots with encoder zeros off by 1 deg, springs by 2 % and lengths by 1 mm.

Tilt is in rad, the others are relative to the signal. Measured: the largest of four payloads in random, periodic and
static trials, rounded up.
"""
SUSPICIOUS = 2.0  # misfit above which something is wrong; poorly calibrated robots stay below 1
FAULT = 1e3  # contribution to the misfit of a fault that lasts all the time
RIGID = ("rotation", "velocity", "tilt", "force", "moment")
_LEAST_SPAN_M = 0.3
_RANK = 1e-12

DECISIVE = 4.0  # factor by which undoing mistakes must lower a suspicious misfit
WORTH_TRYING = 0.3  # misfit below which no mistake is searched
OVERWHELMING = 15.0  # factor by which a mistake must lower a misfit that is not suspicious
HELPS = 1.5  # factor by which each of several mistakes must lower the misfit
ALIKE = 1.3  # ratio of misfits below which mistakes cannot be distinguished
MOST = 6
_REFINED = 6

T = TypeVar("T")


@dataclass(frozen=True)
class Misfit:
    """How badly channels fit together."""

    relative: dict[str, float]  # disagreements over their signals (tilt: in rad), by name
    scaled: dict[str, float]  # disagreements over tolerance and noise, by name
    faults: tuple[Fault, ...]  # reasons why the channels cannot be what the map says
    determined: bool  # whether the payload rotates enough to compare grasps
    mass_kg: float | None = None  # best-fitting mass, or None
    span_m: float | None = None  # largest distance of a grasp from the first one, or None
    parts: int | None = None  # number of disagreements, including those left out

    @property
    def total(self) -> float:
        """Mean square of the scaled disagreements, plus a large amount for every fault."""
        squares = [value**2 for value in self.scaled.values()]
        mean = sum(squares) / (self.parts or len(squares)) if squares else 0.0
        total = mean + FAULT * sum(f.share for f in self.faults)
        return total if np.isfinite(total) else np.inf

    @property
    def suspicious(self) -> bool:
        """Whether robots that carry one rigid payload cannot cause such a misfit."""
        return self.total > SUSPICIOUS and self.tells

    @property
    def tells(self) -> bool:
        """Whether the misfit is meaningful: without rotation only noise would be compared."""
        return self.determined or bool(self.faults)


@dataclass(frozen=True)
class Found:
    """A mistake that explains the misfit."""

    mistake: Mistake
    alternatives: tuple[Mistake, ...]  # other mistakes that explain the misfit as well
    misfit: Misfit  # misfit with all other mistakes undone, but not this one
    after: float  # total misfit with this one undone, too

    @property
    def before(self) -> float:
        """Total misfit with all other mistakes undone, but not this one."""
        return self.misfit.total


@dataclass(frozen=True)
class Wiring:
    as_is: Misfit  # misfit of the log as it is
    found: tuple[Found, ...]  # mistakes, the most important first; empty if none is found
    undone: Misfit  # misfit with all of them undone
    hidden: tuple[Mistake, ...]  # mistakes that these data could not show
    tried: int  # number of mistakes tried


class Team:
    """Computes the misfit of one log with mistakes undone.

    Motions of arms and gimbals are cached, since most mistakes leave them unchanged.
    """

    def __init__(self, signals: Signals, arms: Arms, known: dict[Any, Any] | None = None) -> None:
        """Compute every robot's motion; ``known`` are cached motions of arms and gimbals of the same log."""
        self.signals, self._arms = signals, arms
        self._known = {} if known is None else known
        self._body: Body | None = None
        with np.errstate(all="ignore"):
            self._grasps = [self._grasp(signals, robot) for robot in range(signals.robots)]
            self._body = rigid_body([g for g, _ in self._grasps if g is not None], arms.gravity_mps2)
        self.misfit = self._judged(self._grasps, self._body)

    def without(self, mistake: Mistake, enough: float = np.inf) -> Misfit:
        """Return the misfit with a mistake undone; a value above ``enough`` need not be exact."""
        signals, grasps = mistake.undo(self.signals), list(self._grasps)
        with np.errstate(all="ignore"):  # wrong channels may divide by zero: an infinite misfit
            for robot in mistake.robots:
                grasps[robot] = self._grasp(signals, robot)
        same_motion = signals.position is self.signals.position and signals.theta is self.signals.theta
        return self._judged(grasps, self._body if same_motion else None, enough)

    def undone(self, mistake: Mistake) -> Team:
        """Return the team with a mistake undone."""
        return Team(mistake.undo(self.signals), self._arms, self._known)

    def _grasp(self, signals: Signals, robot: int) -> tuple[Grasp | None, tuple[Fault, ...]]:
        arm = self._once(arm_motion, signals, robot, signals.position.values)
        gimbal = self._once(gimbal_motion, signals, robot, signals.theta.values)
        return grasp_motion(signals, robot, arm, gimbal, self._arms)

    def _once(
        self, motion: Callable[[Signals, int, Arms], T], signals: Signals, robot: int, values: Array
    ) -> T:
        key = motion, robot, signals.level, values[:, :, robot].tobytes()
        if key not in self._known:
            self._known[key] = motion(signals, robot, self._arms)
        return self._known[key]

    def _judged(
        self,
        grasps: Sequence[tuple[Grasp | None, tuple[Fault, ...]]],
        body: Body | None,
        enough: float = np.inf,
    ) -> Misfit:
        """Return the misfit of grasps; forces are skipped if the motion's misfit already exceeds ``enough``.

        The noise is that of the log as it is: a hypothesis that turns signals into noise must not gain from it.
        """
        faults = tuple(fault for _, of_robot in grasps for fault in of_robot)
        told = [grasp for grasp, _ in grasps if grasp is not None]
        if not told:
            return Misfit({}, {}, faults, determined=False)
        gravity = self._arms.gravity_mps2
        with np.errstate(all="ignore"):  # absurd channels may overflow: an infinite misfit
            body = body or rigid_body(told, gravity, self._body.noise if self._body is not None else None)
            if body is None:
                return Misfit({}, {}, (*faults, Fault(1.0, "the numbers overflow")), determined=False)
            if len(told) > 1 and not body.turns:
                return _vertical(told, body, faults)
            if body.span > FARTHEST_M:
                faults = (*faults, Fault(1.0, f"the grasps come out {body.span:.3g} m apart"))
            motion = replace(_misfit(body.spread, faults, determined=True), parts=len(RIGID))
            return motion if motion.total > enough else _balanced(told, body, faults)


def _misfit(
    apart: dict[str, tuple[float, float, float]],
    faults: tuple[Fault, ...],
    mass: float | None = None,
    span: float | None = None,
    *,
    determined: bool,
) -> Misfit:
    """Compute the misfit from disagreements, each with its signal and noise."""
    if mass is not None and mass <= 0:
        faults = (*faults, Fault(1.0, f"the forces add up to a mass of {mass:.3g} kg"))
    relative, scaled = {}, {}
    for name, (value, signal, noise) in apart.items():
        relative[name] = value / signal if signal > 0 else 0.0
        scaled[name] = value / max(float(np.hypot(TOLERANCES[name] * signal, noise)), 1e-300)
    return Misfit(relative, scaled, faults, determined, mass, span)


def _balanced(told: list[Grasp], body: Body, faults: tuple[Fault, ...]) -> Misfit:
    """Return the misfit of the motion and of the total wrench in {1} against the ten inertial parameters."""
    N, Q = len(told), len(told[0].omega)
    force = np.stack([g.force @ R.T for g, R in zip(told, body.R_1i, strict=True)])
    moment = cross(body.p_1i[:, None], force)
    reach = max(min(body.span, FARTHEST_M), _LEAST_SPAN_M)
    weights = np.repeat([1.0, 1.0 / reach], 3)
    total = np.concatenate([force.sum(axis=0), moment.sum(axis=0)], axis=1)
    parameters, residual = _fit(body.regressor * weights[:, None], total * weights)
    left = np.sqrt(np.mean(np.sum(residual.reshape(Q, 2, 3) ** 2, axis=2), axis=0))
    exerted = float(np.sqrt(np.mean(np.sum(np.sqrt(np.sum(force**2, axis=-1)), axis=0) ** 2)))
    noise = float(np.sqrt(3 * N) * body.noise[2])
    apart = body.spread | {
        "force": (float(left[0]), exerted, noise),
        "moment": (float(left[1]), exerted, noise),
    }
    return _misfit(apart, faults, float(parameters[0]), body.span if N > 1 else None, determined=True)


def _vertical(told: list[Grasp], body: Body, faults: tuple[Fault, ...]) -> Misfit:
    """Return the misfit that needs no grasp frames: angular speeds and total vertical force."""
    speed = np.stack([np.linalg.norm(g.omega, axis=1) for g in told])
    apart = float(rms(speed - speed.mean(axis=0)) * np.sqrt(len(told) / (len(told) - 1)))
    lift = np.sum([g.lift for g in told], axis=0)
    rise = body.gravity_mps2 + np.mean([g.rise for g in told], axis=0)
    mass = float(lift @ rise / (rise @ rise))
    exerted = rms(np.sum([np.linalg.norm(g.force, axis=-1) for g in told], axis=0))
    parts = {
        "angular speed": (apart, rms(speed), 2.0 * float(body.noise[0])),
        "lift": (rms(lift - mass * rise), exerted, float(np.sqrt(len(told)) * body.noise[2])),
    }
    return _misfit(parts, faults, mass, determined=False)


def _fit(Y: Array, y: Array) -> tuple[Array, Array]:
    """Solve least squares with a regressor (Q, 6, 10) and wrenches (Q, 6); return parameters and residual (6 Q,)."""
    A, b = Y.reshape(-1, Y.shape[-1]), y.ravel()
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    A = A / scale
    x = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=_RANK)[0]
    return x / scale, b - A @ x


def check_wiring(
    signals: Signals,
    arms: Arms,
    advance: Callable[[int], object] = lambda _: None,
    *,
    look_for_hidden: bool = True,
) -> Wiring:
    """Search for wiring mistakes, and for those that these data could not show.

    ``advance`` is called with the number of mistakes tried since the last call.
    """
    design = design_of(arms)
    first = team = Team(signals, arms)
    chain: list[tuple[Mistake, tuple[Mistake, ...]]] = []
    while team.misfit.total > WORTH_TRYING and team.misfit.tells and len(chain) < MOST:
        best, alike, after = _best(team, design, advance)
        if after > team.misfit.total / (HELPS if team.misfit.total > SUSPICIOUS else OVERWHELMING):
            break
        chain.append((best, alike))
        team = team.undone(best)
    if not shows(first.misfit.total, team.misfit.total):
        chain, team = [], first
    found, team = _needed(first, team, chain)
    hidden, tried = _hidden(team, design, advance) if look_for_hidden else ((), 0)
    return Wiring(first.misfit, found, team.misfit, hidden, tried)


def shows(wrong: float, right: float) -> bool:
    """Return whether a mistake that raises the misfit from ``right`` to ``wrong`` would be found."""
    return wrong > max(SUSPICIOUS, DECISIVE * right) or wrong > max(WORTH_TRYING, OVERWHELMING * right)


def _best(
    team: Team, design: OmnidDesign, advance: Callable[[int], object]
) -> tuple[Mistake, tuple[Mistake, ...], float]:
    """Return the mistake that explains most, its equally good alternatives, and the misfit that it leaves."""
    tried: list[tuple[float, int, Mistake]] = []
    least = np.inf
    for suspicion in SUSPICIONS:
        # Wrong encoder zeros are many; they are tried only if nothing else explains the misfit.
        if suspicion is wrong_zero and least <= max(WORTH_TRYING, team.misfit.total / OVERWHELMING):
            break
        for mistake in suspicion(team.signals, design):
            total = team.without(mistake, ALIKE * least + 1e-9).total
            least = min(least, total)
            tried.append((total, len(tried), mistake))
            advance(1)
    tried.sort(key=lambda entry: entry[:2])
    top = []
    for total, rank, mistake in tried[:_REFINED]:
        better = refined(mistake, lambda m: team.without(m).total)
        top.append((total if better is mistake else team.without(better).total, rank, better))
    limit = ALIKE * min(entry[0] for entry in top) + 1e-9
    # Among equally good mistakes, the earliest suspicion comes first.
    alike = sorted((entry for entry in (*top, *tried[_REFINED:]) if entry[0] <= limit), key=lambda e: e[1])
    # Several offsets of one encoder count as one mistake.
    distinct: dict[object, Mistake] = {}
    for _, _, mistake in alike:
        one = mistake if mistake.resized is None else (mistake.robots, mistake.channels)
        distinct.setdefault(one, mistake)
    first, *others = distinct.values()
    return first, tuple(others), alike[0][0]


def _alike(others: Team, best: Mistake, alike: tuple[Mistake, ...]) -> tuple[Mistake, ...]:
    """Return the alternatives that still explain as much once all other mistakes are undone."""
    limit = ALIKE * others.without(best).total + 1e-9
    return tuple(mistake for mistake in alike if others.without(mistake).total <= limit)


def _needed(
    first: Team, team: Team, chain: list[tuple[Mistake, tuple[Mistake, ...]]]
) -> tuple[tuple[Found, ...], Team]:
    """Return the mistakes of the chain that still matter once all others are undone, and the team without them."""
    found = []
    for k in reversed(range(len(chain))):
        others = first
        for mistake, _ in (*chain[:k], *chain[k + 1 :]):
            others = others.undone(mistake)
        # If something else is wrong, too, report only overwhelming improvements.
        worth = OVERWHELMING if team.misfit.suspicious else HELPS
        if others.misfit.total <= worth * team.misfit.total:
            chain, team = [*chain[:k], *chain[k + 1 :]], others
        else:
            found.append(Found(chain[k][0], _alike(others, *chain[k]), others.misfit, team.misfit.total))
    return tuple(reversed(found)), team


def _hidden(
    team: Team, design: OmnidDesign, advance: Callable[[int], object]
) -> tuple[tuple[Mistake, ...], int]:
    """Return mistakes that would not be found in these data, without wrong encoder zeros, and how many were tried."""
    enough = max(SUSPICIOUS, DECISIVE * team.misfit.total)
    every = (mistake for suspicion in SUSPICIONS for mistake in suspicion(team.signals, design))
    tried = [mistake for mistake in every if mistake.resized is None]
    hidden = []
    for mistake in tried:
        if not shows(team.without(mistake, enough).total, team.misfit.total):
            hidden.append(mistake)
        advance(1)
    return tuple(hidden), len(tried)
