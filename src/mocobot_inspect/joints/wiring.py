"""Exchanged joints and wrong signs: each is undone, alone, and what lets the model explain the torques is reported.

A joint's torque is what the model asks for, times a gain, plus rotor inertia, plus friction of either kind, plus an
offset; gain, inertia and friction cannot be negative. What is left of its variance is the joint's misfit: small where
signs and joints are right, however wrong masses are, near 1 where they are not. Rows in which a joint rests are left
out: dry friction has any value there. A payload that the model lacks, made of point masses, competes with the mistakes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from estimator.arrays import Array
from mocobot_inspect.joints.motion import Motion, effort, passed_noise
from mocobot_inspect.joints.robot import Robot

Kind = Literal[
    "torque_sign", "position_sign", "both_signs", "torque_exchange", "position_exchange", "both_exchange",
    "position_degrees", "position_radians", "payload",
]  # fmt: skip
SUSPICIOUS = 0.2
"""Misfit above which a joint is suspected. Measured on healthy logs: 0.003 to 0.01 at joints of a real arm, 0.11 and
0.27 at two whose drives are coupled; up to 0.08 on 24 simulated arms of seven joints with masses and centres off by
10 or 50 %, none of which was suspected of anything."""
DECISIVE, DECISIVE_UNSUSPECTED = 3.0, 5.0
"""So many times smaller must undoing a mistake make the misfit of the joints that it concerns; the second where none of
them is suspected: rubbing joints hide that they are exchanged as wholes, 7 to 12 times on a real arm."""
SAME = 2.0
"""Mistakes whose misfits, multiplied over the joints, differ by less cannot be told apart."""
WORTH = 0.03
"""Misfit above which a payload is thought of."""
_FLOOR = 1e-4  # of a misfit
_PLAUSIBLE = (
    "payload", "torque_sign", "position_sign", "torque_exchange", "position_exchange", "both_exchange", "both_signs",
    "position_degrees", "position_radians",
)  # fmt: skip
"""What is named first of mistakes that cannot be told apart."""
_CHANGED = 1.5  # a joint is concerned by a mistake that changes its misfit by so much
_SLOW = 0.05  # of the rms speed, below which the sign of a speed means nothing
_LEAST_TORQUE = 1e-9
_LEAST_ROWS = 20
WRONG_SCALE = 8.0
"""Gains of the model's torque beyond this, or below its inverse, are no wrong mass."""
SHOWS = 0.3
"""Share of a torque's variance that the model's must make up for its gain to be known."""
_POINTS = np.array(list(product((-0.3, -0.15, 0.0, 0.15, 0.3), repeat=3))).T  # of a payload's masses [m]
_TURN = 2.0 * np.pi  # hardly any joint moves farther, and hardly any log is of less than so many degrees


@dataclass(frozen=True)
class Mistake:
    """Something wrong with the columns of one joint, of two, or of all.

    Attributes:
        kind: what it is; degrees are taken for radians, or radians for degrees; of a payload only the model is wrong.
        joints: of the model, from 0.
    """

    kind: Kind
    joints: tuple[int, ...]

    @property
    def of_positions(self) -> bool:
        """Whether positions are concerned, and with them all torques that the model asks for."""
        return self.kind.startswith(("position", "both"))

    @property
    def of_torques(self) -> bool:
        """Whether torques are concerned."""
        return self.kind.startswith(("torque", "both"))

    def moved(self, values: Array) -> Array:
        """Positions, or a derivative of theirs, without it, shape (Q, J)."""
        return self._undone(values) if self.of_positions else values

    def torques(self, values: Array) -> Array:
        """Torques without it, shape (Q, J)."""
        return self._undone(values) if self.of_torques else values

    def _undone(self, values: Array) -> Array:
        out, own = values.copy(), list(self.joints)
        if self.kind.endswith("exchange"):
            out[:, own] = values[:, own[::-1]]
        elif self.kind == "position_degrees":
            out[:, own] *= np.pi / 180.0
        elif self.kind == "position_radians":
            out[:, own] *= 180.0 / np.pi
        else:
            out[:, own] *= -1.0
        return out


@dataclass(frozen=True, eq=False)
class Found:
    """A mistake that explains what is wrong.

    Attributes:
        mistake: what it is.
        before, after: misfit of its joints as they are and with it undone.
        alternatives: mistakes of the same joints that the log cannot tell from it.
    """

    mistake: Mistake
    before: float
    after: float
    alternatives: tuple[Mistake, ...]


@dataclass(frozen=True, eq=False)
class Wiring:
    """What torques and motion say of each other.

    Attributes:
        misfit: of every joint as it is, NaN without a torque or motion, shape (J,).
        undone: the same with all found mistakes undone, shape (J,).
        found: the mistakes.
        tried: how many were tried.
        noise: share of each torque that is noise, shape (J,).
        gains: of the model's torque in each joint's, all undone, NaN where it does not show, shape (J,).
        payload: ten inertial parameters of what the last link carries and the model lacks, or None.
    """

    misfit: Array
    undone: Array
    found: tuple[Found, ...]
    tried: int
    noise: Array
    gains: Array
    payload: Array | None

    @property
    def odd_gains(self) -> NDArray[np.bool_]:
        """Joints whose torque is so many times what the model asks for that no mass explains it, shape (J,)."""
        return _odd(self.gains)


@dataclass(frozen=True, eq=False)
class _Case:
    """Signals as they are believed to be.

    Attributes:
        q, dq, ddq, torque: shape (Q, J).
        asked: torques of the model and a payload, shape (Q, J).
        misfit, gains: of every joint, shape (J,).
        payload: ten inertial parameters of what the last link carries, or None.
    """

    q: Array
    dq: Array
    ddq: Array
    torque: Array
    asked: Array
    misfit: Array
    gains: Array
    payload: Array | None

    @classmethod
    def of(cls, robot: Robot, signals: Sequence[Array], payload: Array | None = None) -> _Case:
        """From positions, their derivatives and torques."""
        q, dq, ddq, torque = signals
        asked = robot.asked(q, dq, ddq, payload)
        return cls(q, dq, ddq, torque, asked, *misfits(asked, dq, ddq, torque), payload)

    def without(self, mistake: Mistake, robot: Robot) -> _Case:
        """The same with a mistake undone."""
        q, dq, ddq = (mistake.moved(x) for x in (self.q, self.dq, self.ddq))
        torque = mistake.torques(self.torque)
        if mistake.of_positions or mistake.kind == "payload":
            payload = _payload(self, robot) if mistake.kind == "payload" else self.payload
            return _Case.of(robot, (q, dq, ddq, torque), payload)
        return _Case(q, dq, ddq, torque, self.asked, *misfits(self.asked, dq, ddq, torque), self.payload)

    @property
    def score(self) -> float:
        """Logarithm of the product of all misfits."""
        return float(np.nansum(np.log(self.misfit + _FLOOR)))


def check_wiring(
    motions: Sequence[Motion], robot: Robot, advance: Callable[[int], object] = lambda _: None
) -> Wiring | None:
    """Try every mistake; None where no joint with a torque moves.

    Args:
        motions: of every part of the log.
        robot: its model.
        advance: takes the number of mistakes tried.
    """
    signals = [
        np.concatenate([getattr(motion, name) for motion in motions]) for name in ("q", "dq", "ddq", "torque")
    ]
    case = _Case.of(robot, signals)
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
        best = min(same, key=lambda each: _PLAUSIBLE.index(each.kind))
        undone, before, after = better[best]
        others = (mistake for mistake in same if mistake != best and set(mistake.joints) & set(best.joints))
        if best.kind != "payload":
            found.append(Found(best, before, after, tuple(others)))
        case = undone
    noise = [passed_noise(m.log, effort(m.log)[m.at], m.torque) ** 2 for m in motions]
    share = np.max(noise, axis=0) / np.maximum(np.var(case.torque, axis=0), _LEAST_TORQUE**2)
    return Wiring(as_is, case.misfit, tuple(found), tried, share, case.gains, case.payload)


def misfits(asked: Array, dq: Array, ddq: Array, torque: Array) -> tuple[Array, Array]:
    """Share of each joint's torque that model, rotor inertia and friction leave unexplained, and the model's gain.

    NaN where they are unknown, shape (J,) each.

    Args:
        asked: torques of the model, shape (Q, J).
        dq, ddq: motion, shape (Q, J).
        torque: measured, shape (Q, J).
    """
    out, gains = np.full((2, dq.shape[1]), np.nan)
    for j in range(dq.shape[1]):
        at = _told(dq[:, j], torque[:, j])
        if at.sum() < _LEAST_ROWS or np.std(torque[at, j]) < _LEAST_TORQUE or not np.any(dq[:, j]):
            continue
        values, left = fit(asked[at, j], dq[at, j], ddq[at, j], torque[at, j])
        out[j] = np.var(left) / np.var(torque[at, j])
        if np.var(values[0] * asked[at, j]) > SHOWS * np.var(torque[at, j]):
            gains[j] = values[0]
    return out, gains


def _told(dq: Array, torque: Array) -> NDArray[np.bool_]:
    """Rows of a joint that tell something: it has a torque, and moves; shape (Q,)."""
    return np.isfinite(torque) & (np.abs(dq) >= _SLOW * np.sqrt(np.mean(dq**2)))


def _odd(gains: Array) -> NDArray[np.bool_]:
    return (gains > WRONG_SCALE) | (gains < 1.0 / WRONG_SCALE)


def _payload(case: _Case, robot: Robot) -> Array | None:
    """Ten inertial parameters of point masses at the last link that explain most, all joints taken together.

    None where there are none, or where they outweigh the robot.
    """
    x, y, z = _POINTS
    points = np.stack([x**0, x, y, z, y**2 + z**2, x**2 + z**2, x**2 + y**2, -x * y, -x * z, -y * z])
    regressor = robot.regressor(case.q, case.dq, case.ddq) @ points
    blocks, torques = [], []
    for j in np.flatnonzero(np.isfinite(case.misfit)):
        at = _told(case.dq[:, j], case.torque[:, j])
        own = columns_of(case.asked[at, j], case.dq[at, j], case.ddq[at, j])
        among = np.zeros((len(own), len(robot.joints), own.shape[1]))
        among[:, j] = own
        size = np.std(case.torque[at, j])
        blocks.append(np.hstack([regressor[at, j], among.reshape(len(own), -1)]) / size)
        torques.append(case.torque[at, j] / size)
    values, _ = _nonnegative(np.concatenate(blocks), np.concatenate(torques))
    masses = values[: points.shape[1]]
    return points @ masses if 0.0 < masses.sum() <= robot.mass_kg else None


def fit(asked: Array, dq: Array, ddq: Array, torque: Array) -> tuple[Array, Array]:
    """Gain of the model, rotor inertia, dry and viscous friction (none negative) and two offsets; what they leave.

    Args:
        asked, dq, ddq, torque: of one joint, shape (Q,) each.
    """
    return _nonnegative(columns_of(asked, dq, ddq), torque)


def columns_of(asked: Array, dq: Array, ddq: Array) -> Array:
    """Columns of ``fit``, shape (Q, 6)."""
    speed = float(np.sqrt(np.mean(dq**2)))
    direction = np.clip(dq / max(_SLOW * speed, 1e-12), -1.0, 1.0)
    return np.column_stack([asked, ddq, direction, dq, np.ones_like(dq), -np.ones_like(dq)])


def _nonnegative(columns: Array, y: Array) -> tuple[Array, Array]:
    """Least squares without negative values, and what they leave."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    short = np.asarray(np.linalg.qr(np.column_stack([columns / size, y]), mode="r"))
    values = nnls(short[:, :-1], short[:, -1], maxiter=30 * len(size))[0] / size
    return values, y - columns @ values


def _candidates(case: _Case, robot: Robot) -> Iterator[Mistake]:
    """Mistakes that concern at least one suspected joint, and exchanges of whole joints."""
    if case.payload is None and (_odd(case.gains).any() or np.any(case.misfit > WORTH)):
        yield Mistake("payload", ())
    suspected = {int(j) for j in np.flatnonzero(case.misfit > SUSPICIOUS)}
    moving = [int(j) for j in np.flatnonzero(np.any(case.dq, axis=0))]
    turning = tuple(j for j in moving if not robot.slides[j])
    spans = np.ptp(case.q[:, turning], axis=0)
    if len(spans) and spans.max() > _TURN:
        yield Mistake("position_degrees", turning)
    if len(spans) and np.degrees(spans.max()) < 2.0 * _TURN:
        yield Mistake("position_radians", turning)
    if len(suspected) > 1:
        yield Mistake("torque_sign", tuple(range(len(robot.joints))))
    for j in moving if suspected else ():
        # A sign of a position shows in the torques of other joints, too.
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
    """Misfit before and after of the joints that a mistake concerns, if undoing it mends them and harms no other."""
    before, after = case.misfit, undone.misfit
    known = np.isfinite(before) & np.isfinite(after)
    if np.any(after[known] > np.maximum(2.0 * before[known], SUSPICIOUS)):
        return None
    own = np.zeros(len(before), dtype=bool)
    if (
        mistake.of_torques or 1 <= len(mistake.joints) <= 2
    ):  # not every joint shows that all positions are wrong
        own[list(mistake.joints)] = True
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
