"""Dry and viscous friction, the same in both directions: what every geared joint has."""

import itertools

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction, slow_shapes


class Friction(Cause):
    """A torque against the motion: a constant, which fades below ``slow_per_s``, and one in proportion to the speed.

    They are one cause, since one alone would be looked for in vain where both are missing: of all single numbers some
    power of the speed fits best then.
    """

    title = "friction in {joint}"
    family = "friction"
    dry = True
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    scales = (1.0, 1.0)
    separate = "Steady motions at several speeds in either direction."

    def normal(self, tree, at):
        # A model that names but one of them has fitted neither.
        named = [float(tree.coulomb[at]), float(tree.viscous[at])]
        return [rules.JOINT_SHARE * x for x in named] if all(named) else [0.0, 0.0]

    def sentence(self, n):
        dry, more = n("coulomb_Nm", "N m"), n.either("coulomb_Nm", "more", "less")
        wet, faster = n("viscous_Nms_per_rad", "N m s/rad"), n.either("viscous_Nms_per_rad", "more", "less")
        soft = (
            f", after it has given way by {1e3 * n.values['bristle_rad']:.2g} mrad"
            if "bristle_rad" in n.values
            else ""
        )
        return f"rubs with {dry} {more} than modelled while it moves (Coulomb){soft}, and {wet} {faster} (viscous)"

    def columns(self, signals, at, shape):
        if "bristle_rad" in shape:
            side = bent(signals.q[:, at], shape["bristle_rad"])
        else:
            side = direction(signals, at, shape["slow_per_s"])
        return at_joint(signals, at, side, signals.dq[:, at])

    def shapes(self, hints, at):
        rigid = slow_shapes(hints, at, rules.SLOW_SHARES)
        # Of a joint that slides, nobody knows how far its seals bend.
        return [*rigid, *(dict(rigid[0]) | {"bristle_rad": b} for b in rules.BRISTLES_RAD if hints.turns[at])]

    def finer(self, shape):
        low, high = (edge * rules.BRISTLES_RAD[k] for edge, k in ((0.5, 0), (2.0, -1)))
        near = (factor * shape["bristle_rad"] for factor in (0.8, 1.25)) if "bristle_rad" in shape else ()
        return [dict(shape) | {"bristle_rad": b} for b in near if low <= b <= high]


def bent(q: np.ndarray, bristle: float) -> np.ndarray:
    """How far a contact is bent, over how far it bends before it slips, in [-1, 1], shape (W,).

    Dahl, "A solid friction model" (1968): while the way goes on in one direction what is missing falls by the factor e
    in each length of a bristle. It starts out straight.

    Args:
        q: way, shape (W,).
        bristle: its length, in the same unit.
    """
    step = np.diff(q, prepend=q[0])
    turns = np.flatnonzero(np.diff(np.sign(step))) + 1
    out, last = np.empty_like(q), 0.0
    for a, b in itertools.pairwise([0, *turns, len(q)]):
        way = np.cumsum(step[a:b])
        side = np.sign(way[-1])
        out[a:b] = side + (last - side) * np.exp(-np.abs(way) / bristle) if side else last
        last = float(out[b - 1])
    return out
