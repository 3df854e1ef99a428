"""Something hangs at a link that the model does not have."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.causes.link_inertia import AXES as MOMENTS
from discrepancy.serial.causes.link_inertia import symmetric
from discrepancy.serial.mechanics.regressor import body_regressor, inertial_parameters
from discrepancy.serial.rows.moved import with_tree

AXES: tuple[str, ...] = ("x_m", "y_m", "z_m")


class Payload(Cause):
    """A rigid payload at a link: a mass about some point of its frame, with the inertia of a ball, more or less.

    Mass, centre and inertia come as one, so that what they explain together is not shared among the link's own.
    """

    title = "payload at {link}"
    family = "inertia"
    part = "link"
    parameters = ("mass_kg", *(f"inertia_{axes}_kgm2" for axes in MOMENTS))
    scales = (1.0, *(rules.PAYLOAD_INERTIA_SHARE * rules.PAYLOAD_GYRATION_M**2,) * 6)
    separate = "The arm without it."
    reversible = True
    merges = True

    def sentence(self, n):
        at = ", ".join(n(axis, "", 1e3, signed=True) for axis in AXES)
        more = n.either("mass_kg", "more", "less")
        return f"carries {n('mass_kg', 'kg')} {more} than modelled, centred at ({at}) mm of its frame"

    def possible(self, tree, at, values, se):
        moments = ball_inertia(values[0]) + symmetric(values[1:])
        # A mass has a density nowhere below zero: the second moments of it, not only the moments of inertia.
        second = 0.5 * np.trace(moments) * np.eye(3) - moments
        off = 2.0 * max(ball_inertia(se[0])[0, 0], *se[1:])
        return bool(values[0] > -2.0 * se[0] and np.linalg.eigvalsh(second)[0] > -off)

    def columns(self, signals, at, shape):
        centre = np.array([shape[axis] for axis in AXES])
        regressor = body_regressor(signals.motion, int(signals.tree.joint_body[at]))
        mass = regressor @ inertial_parameters(1.0, centre, ball_inertia(1.0))
        return np.concatenate([mass[..., None], regressor[..., 4:]], axis=2)

    def applied(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        centre = np.array([shape[axis] for axis in AXES])
        moments = ball_inertia(values[0]) + symmetric(values[1:])
        mass = tree.mass[b] + values[0]
        com = (tree.mass[b] * tree.com[b] + values[0] * centre) / mass
        about = [
            inertia + m * ((c - com) @ (c - com) * np.eye(3) - np.outer(c - com, c - com))
            for m, c, inertia in ((tree.mass[b], tree.com[b], tree.inertia[b]), (values[0], centre, moments))
        ]
        here = np.arange(len(tree.mass)) == b
        return with_tree(
            signals,
            mass=np.where(here, mass, tree.mass),
            com=np.where(here[:, None], com, tree.com),
            inertia=np.where(here[:, None, None], sum(about), tree.inertia),
        )

    def shapes(self, hints, at):
        away = [sign * d * e for d in rules.PAYLOAD_M for e in np.eye(3) for sign in (1.0, -1.0)]
        return [dict(zip(AXES, map(float, c), strict=True)) for c in (np.zeros(3), *away)]

    def finer(self, shape):
        return [dict(shape) | {a: shape[a] + d} for a in AXES for d in rules.PAYLOAD_FINER_M]

    def closer(self, shape):
        return [{axis: share * shape[axis] for axis in AXES} for share in rules.PAYLOAD_CLOSER]

    def steps(self, shape):
        return {axis: rules.PAYLOAD_STEP_M for axis in AXES}


def ball_inertia(mass: float) -> np.ndarray:
    """About the centre of a payload of the usual size [kg m^2], to which its own is added, shape (3, 3)."""
    return mass * rules.PAYLOAD_GYRATION_M**2 * np.eye(3)
