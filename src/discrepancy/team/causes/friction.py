"""Friction of driven joints, gimbal axes and springs: sliding, at rest, and presliding."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from discrepancy.team.causes.base import Cause, Shape, one_joint, one_robot
from discrepancy.team.linear.rest import REST_RAD_PER_S
from discrepancy.team.linear.rows import PATCH_COLUMNS, Patches
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.dynamics import moment_about_axes
from estimator.arm.motion import TAU, THETA
from estimator.arrays import Array
from estimator.filtering import differentiate


def pieces_while(
    where: NDArray[np.bool_], rate_hz: float, knots_s: float, shortest_s: float = 0.0
) -> Iterator[tuple[slice, Array]]:
    """For each interval of ``where`` (Q,), yield its s samples and k hat functions, shape (s, k).

    Args:
        where: mask of the samples.
        rate_hz: sampling rate [Hz].
        knots_s: largest distance between knots [s].
        shortest_s: shorter intervals are skipped [s].
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int))).reshape(-1, 2)
    for start, stop in edges:
        if stop - start < shortest_s * rate_hz:
            continue
        pieces = math.ceil((stop - start) / rate_hz / knots_s)
        knots, here = np.linspace(start, stop - 1, pieces + 1), np.arange(start, stop)
        yield (
            slice(start, stop),
            np.stack([np.interp(here, knots, unit) for unit in np.eye(pieces + 1)], axis=1),
        )


def in_parts(pieces: Iterator[tuple[slice, Array]], most: int) -> Iterator[tuple[slice, Array]]:
    """Split the functions into at most ``most`` columns at a time, and trim samples where they are zero."""
    for at, values in pieces:
        for first in range(0, values.shape[1], most):
            some = values[:, first : first + most]
            there = np.flatnonzero(some.any(axis=1))
            here = slice(there[0], there[-1] + 1)
            yield slice(at.start + here.start, at.start + here.stop), some[here]


def played(x: Array, half_width: float) -> Array:
    """Play operator: follow a signal (Q,) at a distance of at most ``half_width``.

    Along a monotonic part of the signal only its start matters, so the loop runs over turning points, not over samples.
    """
    moves = np.flatnonzero(np.diff(x))  # samples that move
    way = np.sign(np.diff(x)[moves])
    turns = moves[1:][way[1:] != way[:-1]]
    ends, at, starts = [*x[turns].tolist(), float(x[-1])], float(x[0]), []
    for end in ends:
        starts.append(at)
        at = min(max(at, end - half_width), end + half_width)
    counts = np.diff([0, *(turns + 1), len(x)])  # a turn ends the run before it
    start = np.repeat(starts, counts)
    return np.clip(start, x - half_width, x + half_width)


PRESLIDING_OPEN_SHARE = 0.5
"""Standard deviation of presliding friction around Prandtl's law, over the friction limit. Chosen."""

PRESLIDING_FINER = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""Factors of a presliding displacement tried next. Chosen."""

PRESLIDINGS_RAD, PRESLIDING_RANGE_RAD = (5e-4, 2e-3), (5e-5, 1e-2)
"""Presliding angles tried first, and their range [rad]. Chosen: bristles yield by 0.2 to 2 mrad."""

REST_KNOTS_S = 0.05
"""Time between knots of friction at rest, which follows load [s]. Derived: the rows' filter stops faster changes."""

TURN_RAD_PER_S = 1e-2
"""Speed below which friction with a kept direction may not have reversed yet after a turn [rad/s]. Chosen."""

KEPT = "kept_below_rad_per_s"
"""Shape number: speed below which friction keeps its direction, with a presliding too stiff for encoders [rad/s]."""


class Friction(Cause):
    """Friction of a joint: Coulomb and, unless a cause has one parameter only, viscous.

    The shape selects the behaviour at rest. Below the given rate friction may have any value up to its limit, or it
    keeps its direction. Or it follows Prandtl's law: it grows with displacement before it slips, and a full reversal
    takes twice the presliding displacement.

    Attributes:
        moves: signal that shows the joint's motion.
        sign: sign of the error in the torque reading while that signal grows.
        gives: name of the presliding displacement, in units of the signal.
    """

    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    tolerances = (2e-3, 2e-3)
    clipped = ("coulomb_Nm", "viscous_Nms_per_rad")
    shapes = (
        {"slow_rad_per_s": 1e-3}, {"slow_rad_per_s": 4e-3}, {KEPT: 4e-3},
        *({"presliding_rad": x} for x in PRESLIDINGS_RAD),
    )  # fmt: skip
    determined: ClassVar[Mapping[str, float]] = {"presliding_rad": 0.1}
    refined: ClassVar = {"presliding_rad": (PRESLIDING_FINER, PRESLIDING_RANGE_RAD)}
    positive = ("coulomb_Nm",)
    moves: ClassVar[Literal["phi", "theta", "tau"]] = "phi"
    sign: ClassVar[float] = 1.0
    gives: ClassVar[str] = "presliding_rad"

    def sentence(self, n):
        soft = f", after it has given way by {n(self.gives, 'mrad', 1e3)}" if n.values.get(self.gives) else ""
        return (
            f"the {self.at} rubs with {n('coulomb_Nm', 'N m')} (Coulomb, while it moves{soft}) and "
            f"{n('viscous_Nms_per_rad', 'N m s/rad')} (viscous)"
        )

    def physical(self, values, context):
        return super().physical(values, context) | {self.gives: context.shape.get(self.gives, 0.0)}

    def direction(self, trial: TrialLinear, robot: int, joint: int) -> Array:
        """Residual samples per 1 N m of friction torque, shape (Q, C)."""
        return trial.J(robot, TAU, np.eye(3)[joint])

    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        states = np.stack(self._sliding(trial.signals, trial, robot, joint, shape), axis=-1)
        return trial.reduction(self.direction(trial, robot, joint)[..., None] * states[:, None])

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals | None:
        torque = np.zeros(len(signals.time))
        for value, state in zip(values, self._sliding(signals, trial, robot, joint, shape), strict=True):
            torque += value * state
        return signals.minus(tau=one_robot(one_joint(torque, joint), trial.robots, robot))

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Patches:
        """Latent states of friction that does not slip: any torque up to its limit, which changes with the load.

        With presliding, they include the displacement before the first slip, and a deviation from Prandtl's law until
        friction slips. With a kept direction, they include any value while the joint turns round or moves too slowly to
        tell its direction.
        """
        bent, rate, *_ = (*self._sliding(trial.signals, trial, robot, joint, shape), None)
        state = np.abs(bent)
        open_ = state < 1.0 - 1e-9 if KEPT not in shape else _doubtful(bent, rate)
        rests = pieces_while(open_, trial.signals.rate_hz, REST_KNOTS_S)
        rests = in_parts(rests, PATCH_COLUMNS)
        if self.gives in shape or KEPT in shape:
            slips = np.flatnonzero(state >= 1.0 - 1e-9)
            before = slice(0, slips[0] if len(slips) else len(state))
            share = PRESLIDING_OPEN_SHARE if self.gives in shape else 1.0
            rests = ((at, share * values) for at, values in rests)
            rests = chain([(before, np.ones((before.stop, 1)))] if before.stop else [], rests)
        return trial.reduction.of_pieces(self.direction(trial, robot, joint), rests)

    def _sliding(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, shape: Shape
    ) -> Sequence[Array]:
        """Direction of motion in [-1, 1], which fades to zero at rest, and rate; as many as there are parameters.

        With presliding, the first is the presliding displacement over its limit. Angles are used without their noise:
        otherwise that noise would separate the frictions of parallel axes that move alike.
        """
        (number,) = shape.values()
        smooth = signals.smooth(self.moves, robot, joint)
        if self.moves != "tau":
            read, quiet = (one.smooth(self.moves, robot, joint) for one in (trial.signals, trial.adjusted))
            smooth = smooth - (read - quiet)
        rate = self.sign * differentiate(smooth, signals.rate_hz)
        if self.gives in shape:
            bent = self.sign * (smooth - played(smooth, number)) / number
        else:
            bent = _kept(rate, number) if KEPT in shape else rate / number
        return (np.clip(bent, -1.0, 1.0), rate)[: len(self.parameters)]


def _kept(rate: Array, slow: float) -> Array:
    """Direction of motion, shape (Q,). At rest it is that of the motion before, and 0 until the first motion.

    Only motions that exceed the rate ``slow`` count. Each begins where its rate last left zero.
    """
    out, way = np.zeros_like(rate), np.sign(rate)
    starts, fastest = _motions(rate)
    for start in starts[fastest >= slow]:
        out[start:] = way[start]
    return out


def _doubtful(kept: Array, rate: Array) -> NDArray[np.bool_]:
    """Samples where a joint rests, turns round, or may move against the kept direction, shape (Q,).

    At rest friction holds any load. It reverses only once the joint has moved by more than the presliding displacement,
    which may be below the encoder's resolution. A law that reverses at once would mistake that for a late torque
    sensor.
    """
    starts, fastest = _motions(rate)
    counts = np.diff([*starts, len(rate)])
    fast = np.concatenate([np.zeros(len(rate) - int(counts.sum())), np.repeat(fastest, counts)])
    return (np.abs(rate) < TURN_RAD_PER_S) | ((kept * rate < 0.0) & (fast >= REST_RAD_PER_S))


def _motions(rate: Array) -> tuple[NDArray[np.intp], Array]:
    """Start of each motion in one direction, and its largest speed."""
    starts = np.flatnonzero(np.diff(np.sign(rate), prepend=0.0))
    return starts, np.maximum.reduceat(np.abs(rate), starts) if len(starts) else np.zeros(0)


PRESLIDING_RANGE_NM = (0.01, 1.0)
"""Range of presliding torques [N m]. Derived: smaller ones pass within a sample; larger ones hardly ever reverse."""

PRESLIDINGS_NM = (0.05, 0.2)
"""Presliding torques of friction inside a spring tried first [N m]. Chosen."""


class SeaHysteresis(Friction):
    """Friction parallel to the spring: while the torque grows, the link gets more than the deflection shows.

    A torque that changes more slowly than ``slow_Nm_per_s`` counts as at rest.
    """

    title = "friction inside the spring of {driven joint}"
    parameters = ("friction_Nm",)
    tolerances = (2e-3,)
    clipped = ()
    shapes = (
        {"slow_Nm_per_s": 0.2}, {"slow_Nm_per_s": 0.6}, *({"presliding_Nm": x} for x in PRESLIDINGS_NM)
    )  # fmt: skip
    determined: ClassVar = {"presliding_Nm": 0.1}
    refined: ClassVar = {"presliding_Nm": (PRESLIDING_FINER, PRESLIDING_RANGE_NM)}
    positive = ("friction_Nm",)
    moves = "tau"
    sign = -1.0
    gives = "presliding_Nm"
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def sentence(self, n):
        soft = (
            f", and gives way over {n(self.gives, 'N m')} before it slips" if n.values.get(self.gives) else ""
        )
        return f"the spring rubs inside, with {n('friction_Nm', 'N m')}{soft}"


class JointFriction(Friction):
    """A moving link gets less torque than the spring provides; below ``slow_rad_per_s`` it rests."""

    title = "friction in {driven joint}"
    separate = "An arm-only run (payload released) shows friction of the joint alone."


class GimbalFriction(Friction):
    """The gimbal exerts a friction moment on the payload about its axis (1, 2, 3 are z, y, x).

    A pure moment acts the same at every place, so gimbals with parallel axes cannot be distinguished.
    """

    title = "friction in {gimbal axis}"
    at = "gimbal joint"
    moves = "theta"
    separate = "Which robot's gimbal rubs shows only with one robot released at a time."
    undo = Cause.undo  # no sensor reads this friction

    def direction(self, trial, robot, joint):
        """Residual samples per 1 N m of external moment against the axis, shape (Q, C)."""
        moment = moment_about_axes(trial.s[:, robot, THETA], np.eye(3)[joint])
        moment = moment @ trial.shared.grasps.R_1i[robot].T
        return np.concatenate([np.zeros((len(moment), trial.channels - 3)), moment], axis=1)
