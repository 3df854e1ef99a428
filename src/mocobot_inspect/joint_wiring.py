"""Find exchanged joints and wrong signs in a joint log.

Each mistake is undone alone. A mistake is reported if the model then explains the torques.

A joint's torque is fitted by the model's torque times a gain, rotor inertia, Coulomb and viscous friction, and an
offset. Gain, inertia and friction are non-negative. The unexplained share of the variance is the joint's misfit. With
correct signs and joints it is small even if masses are wrong; otherwise it is near 1. Rows in which a joint rests are
left out, since Coulomb friction is undetermined there. A payload missing in the model, made of point masses, competes
with the mistakes as an explanation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_inspect.joint_motion import LONGEST_S, Motion, cutoff_hz, solved

Kind = Literal[
    "payload", "torque_sign", "position_sign", "torque_exchange", "position_exchange", "both_exchange", "both_signs",
    "position_degrees", "position_radians",
]  # fmt: skip
"""Kinds of mistakes; if several fit equally well, the first in this order is reported."""
SUSPICIOUS = 0.2
"""Misfit above which a joint is suspected.

Measured on healthy logs of a real arm: 0.003 to 0.01, but 0.11 and 0.27 at two joints with coupled drives. Measured
on 24 simulated seven-joint arms with masses and centres off by 10 or 50 %: up to 0.08, so no joint was suspected.
"""
DECISIVE, DECISIVE_UNSUSPECTED = 3.0, 5.0
"""Factors by which undoing a mistake must lower the misfit of its joints: if one of them is suspected, and if none is.

Friction can hide an exchange of whole joints, so that none is suspected. Measured on a real arm: undoing it lowers
the misfit 7 to 12 times.
"""
SAME = 2.0  # ratio of the products of all joints' misfits below which two mistakes cannot be distinguished
WORTH = 0.03  # misfit above which a payload is tried
WRONG_SCALE = 8.0
"""Largest gain of the model's torque, and inverse of the smallest, that wrong masses can explain."""
SHOWS = 0.3  # least share of a torque's variance that the model must explain for its gain to be known
SLOW = 0.4
"""Share of a joint's rms speed; below it Coulomb friction is undetermined, and leads or lags by milliseconds."""
_FLOOR = 1e-4  # added to a misfit before its logarithm
_CHANGED = 1.5  # a mistake concerns a joint if it changes the joint's misfit by this factor
_RESTS = 0.05  # of the rms speed; below it the sign of the speed is unreliable
_LEAST_TORQUE = 1e-9
_LEAST_ROWS = 20
_POINTS = np.array(list(product((-0.3, -0.15, 0.0, 0.15, 0.3), repeat=3))).T  # point masses of a payload [m]
_TURN = 2.0 * np.pi  # joints rarely move farther in radians, and logs rarely cover less in degrees
_STEPS, _SHARPENED = 10, 3  # delays tried on either side, and number of refinements


@dataclass(frozen=True, eq=False)
class Robot:
    """The robot model that an inspection needs, without a simulator."""

    joints: tuple[str, ...]  # names of its J joints
    slides: NDArray[np.bool_]  # whether each joint slides, shape (J,); the others turn
    # lower, upper: range of each joint [rad or m], infinite if unlimited, shape (J,)
    lower: Array
    upper: Array
    torque_limit: Array  # largest torque of each drive [N m or N], infinite if the model has none, shape (J,)
    # inverse dynamics without friction: positions and their first two derivatives, (Q, J) each -> (Q, J)
    inverse: Callable[[Array, Array, Array], Array]
    # torque regressor of the last link from the same inputs, shape (Q, J, 10). Its inertial parameters are mass, first
    # moments, Ixx, Iyy, Izz, Ixy, Ixz and Iyz about the frame's origin.
    regressor: Callable[[Array, Array, Array], Array]
    mass_kg: float  # mass of all moving links
    notes: tuple[str, ...] = ()  # sentences on what was read otherwise than the model's file says

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's position."""
        return tuple("m" if slides else "rad" for slides in self.slides)

    def asked(self, q: Array, dq: Array, ddq: Array, payload: Array | None) -> Array:
        """Return the torques of the model plus a payload of ten inertial parameters at its last link, shape (Q, J)."""
        own = self.inverse(q, dq, ddq)
        return own if payload is None else own + self.regressor(q, dq, ddq) @ payload


@dataclass(frozen=True)
class Mistake:
    """A mistake in the columns of one joint, of two, or of all."""

    # see ``Kind``; "position_degrees" means degrees taken for radians. A "payload" is wrong only in the model.
    kind: Kind
    joints: tuple[int, ...]  # indices of the joints in the model, from 0

    @property
    def of_positions(self) -> bool:
        """Whether the mistake concerns positions, and therefore all torques of the model."""
        return self.kind.startswith(("position", "both"))

    @property
    def of_torques(self) -> bool:
        """Whether the mistake concerns torques."""
        return self.kind.startswith(("torque", "both"))

    def undone(self, values: Array) -> Array:
        """Return positions, one of their derivatives or torques with the mistake undone, shape (Q, J)."""
        out, own = values.copy(), list(self.joints)
        if self.kind.endswith("exchange"):
            out[:, own] = values[:, own[::-1]]
        else:
            out[:, own] *= {"position_degrees": np.pi / 180.0, "position_radians": 180.0 / np.pi}.get(
                self.kind, -1.0
            )
        return out


@dataclass(frozen=True, eq=False)
class Found:
    """A mistake that explains a misfit."""

    mistake: Mistake
    # before, after: mean misfit of its joints as they are and with it undone
    before: float
    after: float
    alternatives: tuple[Mistake, ...]  # mistakes that share a joint with it and explain the log equally well


@dataclass(frozen=True, eq=False)
class Wiring:
    """Result of the comparison of torques and motion."""

    misfit: Array  # misfit of each joint as it is, NaN without a torque or motion, shape (J,)
    undone: Array  # misfit with all found mistakes undone, shape (J,)
    found: tuple[Found, ...]  # the mistakes
    tried: int  # number of mistakes tried
    noise: Array  # share of each torque's variance that is noise, shape (J,)
    gains: Array  # gain of the model's torque with all mistakes undone, NaN if unknown, shape (J,)
    # ten inertial parameters of a payload that the model lacks at the last link, or None
    payload: Array | None

    @property
    def odd_gains(self) -> NDArray[np.bool_]:
        """Joints whose gain no wrong mass explains, shape (J,)."""
        return _odd(self.gains)


@dataclass(frozen=True)
class TorqueDelay:
    """Delay of the torques behind the motion.

    Attributes:
        delay_s, delay_se_s: delay of all torques, and its standard error [s].
        before, after: unexplained share of their variance without and with the delay.
    """

    delay_s: float
    delay_se_s: float
    before: float
    after: float


class _Case:
    """Signals under a hypothesis, with their misfit.

    Attributes:
        motion: positions and their derivatives, shape (Q, J) each.
        torque: measured torques, shape (Q, J).
        payload: ten inertial parameters of a payload at the last link, or None.
        asked: torques of the model and the payload, shape (Q, J).
        misfit: share of each torque that model, rotor inertia and friction leave unexplained, NaN if unknown,
            shape (J,).
        gains: gain of the model in each torque, NaN if unknown, shape (J,).
    """

    def __init__(
        self,
        robot: Robot,
        motion: tuple[Array, Array, Array],
        torque: Array,
        payload: Array | None = None,
        asked: Array | None = None,
    ) -> None:
        """Compute the misfit; ``asked`` may be given if it is already known."""
        self.motion, self.torque, self.payload = motion, torque, payload
        self.asked = robot.asked(*motion, payload) if asked is None else asked
        self.misfit, self.gains = np.full((2, torque.shape[1]), np.nan)
        for j in range(torque.shape[1]):
            at = self.rows(j)
            y = torque[at, j]
            if at.sum() < _LEAST_ROWS or np.std(y) < _LEAST_TORQUE or not np.any(motion[1][:, j]):
                continue
            values, left = _nonnegative(self.columns(j, at), y)
            self.misfit[j] = np.var(left) / np.var(y)
            if np.var(values[0] * self.asked[at, j]) > SHOWS * np.var(y):
                self.gains[j] = values[0]

    def rows(self, j: int) -> NDArray[np.bool_]:
        """Return the rows in which a joint has a torque and moves, shape (Q,)."""
        dq = self.motion[1][:, j]
        return np.isfinite(self.torque[:, j]) & (np.abs(dq) >= _RESTS * np.sqrt(np.mean(dq**2)))

    def columns(self, j: int, at: NDArray[np.bool_]) -> Array:
        """Return the regressor of a joint's torque in some rows, shape (Q, 6)."""
        return _columns(self.asked[at, j], self.motion[1][at, j], self.motion[2][at, j])

    def without(self, mistake: Mistake, robot: Robot) -> _Case:
        """Return the case with a mistake undone."""
        q, dq, ddq = self.motion
        if mistake.of_positions:
            q, dq, ddq = mistake.undone(q), mistake.undone(dq), mistake.undone(ddq)
        torque = mistake.undone(self.torque) if mistake.of_torques else self.torque
        if mistake.kind == "payload":
            return _Case(robot, (q, dq, ddq), torque, self.lacking(robot))
        return _Case(robot, (q, dq, ddq), torque, self.payload, None if mistake.of_positions else self.asked)

    @property
    def score(self) -> float:
        """Sum of the logarithms of all misfits."""
        return float(np.nansum(np.log(self.misfit + _FLOOR)))

    def lacking(self, robot: Robot) -> Array | None:
        """Return ten inertial parameters of the point masses at the last link that fit all joints best.

        None if there are none, or if they outweigh the robot.
        """
        x, y, z = _POINTS
        points = np.stack([x**0, x, y, z, y**2 + z**2, x**2 + z**2, x**2 + y**2, -x * y, -x * z, -y * z])
        regressor = robot.regressor(*self.motion) @ points
        blocks, torques = [], []
        for j in np.flatnonzero(np.isfinite(self.misfit)).tolist():
            at = self.rows(j)
            own = self.columns(j, at)
            among = np.zeros((len(own), len(robot.joints), own.shape[1]))
            among[:, j] = own
            size = np.std(self.torque[at, j])
            blocks.append(np.hstack([regressor[at, j], among.reshape(len(own), -1)]) / size)
            torques.append(self.torque[at, j] / size)
        values, _ = _nonnegative(np.concatenate(blocks), np.concatenate(torques))
        masses = values[: points.shape[1]]
        return points @ masses if 0.0 < masses.sum() <= robot.mass_kg else None


def check_wiring(
    motions: Sequence[Motion], robot: Robot, advance: Callable[[int], object] = lambda _: None
) -> Wiring | None:
    """Search for mistakes in all parts of a log; return None if no joint with a torque moves.

    ``advance`` is called with the number of mistakes tried.
    """
    q, dq, ddq, torque = (
        np.concatenate([getattr(motion, name) for motion in motions]) for name in ("q", "dq", "ddq", "torque")
    )
    case = _Case(robot, (q, dq, ddq), torque)
    as_is, found, tried = case.misfit, [], 0
    if np.isnan(as_is).all():
        return None
    while len(found) < len(robot.joints):
        better: dict[Mistake, tuple[_Case, float, float]] = {}
        for mistake in _candidates(case, robot):
            undone = case.without(mistake, robot)
            tried += 1
            advance(1)
            judged = _judged(mistake, case, undone)
            if judged is not None:
                better[mistake] = (undone, *judged)
        if not better:
            break
        level = min(undone.score for undone, _, _ in better.values()) + np.log(SAME)
        same = [mistake for mistake, (undone, _, _) in better.items() if undone.score <= level]
        best = min(same, key=lambda each: get_args(Kind).index(each.kind))
        undone, before, after = better[best]
        others = (mistake for mistake in same if mistake != best and set(mistake.joints) & set(best.joints))
        if best.kind != "payload":
            found.append(Found(best, before, after, tuple(others)))
        case = undone
    noise = np.max([m.torque_noise**2 for m in motions], axis=0)
    share = noise / np.maximum(np.var(case.torque, axis=0), _LEAST_TORQUE**2)
    return Wiring(as_is, case.misfit, tuple(found), tried, share, case.gains, case.payload)


def _candidates(case: _Case, robot: Robot) -> Iterator[Mistake]:
    """Yield mistakes that concern a suspected joint, unit errors, exchanges of whole joints, and a payload."""
    if case.payload is None and (_odd(case.gains).any() or np.any(case.misfit > WORTH)):
        yield Mistake("payload", ())
    q, dq, _ = case.motion
    suspected = {int(j) for j in np.flatnonzero(case.misfit > SUSPICIOUS)}
    moving = [int(j) for j in np.flatnonzero(np.any(dq, axis=0))]
    turning = tuple(j for j in moving if not robot.slides[j])
    spans = np.ptp(q[:, turning], axis=0)
    if len(spans) and spans.max() > _TURN:
        yield Mistake("position_degrees", turning)
    if len(spans) and np.degrees(spans.max()) < 2.0 * _TURN:
        yield Mistake("position_radians", turning)
    if len(suspected) > 1:
        yield Mistake("torque_sign", tuple(range(len(robot.joints))))
    for j in moving if suspected else ():
        # A wrong position sign also affects torques of other joints.
        yield Mistake("position_sign", (j,))
        if j in suspected:
            yield Mistake("torque_sign", (j,))
            yield Mistake("both_signs", (j,))
    for pair in combinations(range(len(robot.joints)), 2):
        if robot.slides[pair[0]] == robot.slides[pair[1]]:
            yield Mistake("both_exchange", pair)
            if suspected & set(pair):
                yield Mistake("torque_exchange", pair)
                yield Mistake("position_exchange", pair)


def _judged(mistake: Mistake, case: _Case, undone: _Case) -> tuple[float, float] | None:
    """Return the misfit before and after undoing a mistake, or None if it does not help or harms another joint."""
    before, after = case.misfit, undone.misfit
    known = np.isfinite(before) & np.isfinite(after)
    if np.any(after[known] > np.maximum(2.0 * before[known], SUSPICIOUS)):
        return None
    own = np.zeros(len(before), dtype=bool)
    if mistake.of_torques or len(mistake.joints) in (1, 2):
        own[list(mistake.joints)] = True  # not every joint shows that all positions are wrong
    if not mistake.kind.startswith("torque"):
        ratio = np.divide(after, before, out=np.ones_like(after), where=known)
        own |= (ratio > _CHANGED) | (ratio < 1.0 / _CHANGED)
    own &= known
    mends_gains = mistake.kind == "payload" and _odd(case.gains).sum() > _odd(undone.gains).sum()
    if not own.any() and not mends_gains:
        return None
    was, left = (float(x[own].mean()) if own.any() else 0.0 for x in (before, after))
    factor = DECISIVE if np.any(before[own] > SUSPICIOUS) else DECISIVE_UNSUSPECTED
    return (was, left) if mends_gains or left < was / factor else None


def _odd(gains: Array) -> NDArray[np.bool_]:
    return (gains > WRONG_SCALE) | (gains < 1.0 / WRONG_SCALE)


def _columns(asked: Array, dq: Array, ddq: Array) -> Array:
    """Return the regressor (Q, 6) of a joint's torque: model, rotor inertia, Coulomb and viscous friction, offsets."""
    speed = float(np.sqrt(np.mean(dq**2)))
    direction = np.clip(dq / max(_RESTS * speed, 1e-12), -1.0, 1.0)
    return np.column_stack([asked, ddq, direction, dq, np.ones_like(dq), -np.ones_like(dq)])


def _nonnegative(columns: Array, y: Array) -> tuple[Array, Array]:
    """Return the non-negative least-squares solution and its residual; the first of parallel columns explains them."""
    # A single slide's rotor acts as its mass, and rounding would choose.
    size = np.linalg.norm(columns, axis=0).clip(1e-12) * np.linspace(1.0, 1.0 + 1e-6, columns.shape[1])
    short = np.asarray(np.linalg.qr(np.column_stack([columns / size, y]), mode="r"))
    values = nnls(short[:, :-1], short[:, -1], maxiter=30 * len(size))[0] / size
    return values, y - columns @ values


def torque_delay(motion: Motion, asked: Array) -> TorqueDelay | None:
    """Estimate the delay of all torques behind the motion; samples of slow joints are left out.

    ``asked`` are torques of the model, shape (Q, J). None if no moving joint has a torque.
    """
    log, rate = motion.log, motion.log.rate_hz
    if log.torque is None:
        return None
    joints = np.flatnonzero(np.isfinite(log.torque).all(axis=0) & motion.moves)
    if not len(joints):
        return None
    torque = low_pass(log.torque[:, joints], rate, cutoff_hz(log))
    slope = differentiate(torque, rate)
    time = np.arange(len(torque)) / rate
    speeds = motion.dq[:, joints]
    fast = np.abs(speeds) > SLOW * np.sqrt(np.mean(speeds**2, axis=0))

    def rest(k: int, delay_s: float) -> tuple[Array, Array, float]:
        """Return the active columns of a joint's torque, the residual, and the logarithm of its share."""
        at, j = fast[:, k], joints[k]
        late = np.interp(motion.at[at] / rate + delay_s, time, torque[:, k])
        columns = _columns(asked[at, j], motion.dq[at, j], motion.ddq[at, j])
        values, left = _nonnegative(columns, late)
        return columns[:, values != 0.0], left, float(np.log(np.var(left) / max(np.var(late), 1e-30) + 1e-9))

    def shares(delay_s: float) -> float:
        return float(np.mean([rest(k, delay_s)[2] for k in range(len(joints))]))

    centre, width = 0.0, min(LONGEST_S, 0.1 * len(log.time) / rate)
    for _ in range(_SHARPENED):
        tried = centre + np.linspace(-width, width, 2 * _STEPS + 1)
        centre = float(tried[int(np.argmin([shares(float(delay)) for delay in tried]))])
        width /= _STEPS
    # One Newton step per joint; the scatter between joints reflects errors of the model.
    steps, errors = [], []
    for k in range(len(joints)):
        columns, left, _ = rest(k, centre)
        moved = np.interp(motion.at[fast[:, k]] / rate + centre, time, slope[:, k])
        values, se = solved(np.column_stack([-moved, columns]), left)
        steps.append(values[0])
        errors.append(se[0])
    weights = np.maximum(errors, 1e-12) ** -2.0
    scatter = np.sum(weights * np.square(steps)) / max(len(joints) - 1, 1)
    se = float(np.sqrt(max(1.0, scatter) / np.sum(weights)))
    return TorqueDelay(centre, se, float(np.exp(shares(0.0))), float(np.exp(shares(centre))))
