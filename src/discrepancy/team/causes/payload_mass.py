"""A payload whose mass changes: from one trial to the next, or while a trial lasts."""

import numpy as np

from discrepancy.team import constants
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array
from estimator.inertia import ORDER, inertia_matrix, inertia_parameters
from estimator.rigid_team.residual import balance

MASS_SPANS = 5
"""Up to which trial one may be there for some trials only. Chosen: of five, each span; of more, only what stays."""

MASS_TRIALS = 12
"""With which another mass may begin at most. Chosen: more are no experiment but a log."""

INERTIAS = tuple("xyz"[i] + "xyz"[j] for i, j in ORDER)


class PayloadMass(Cause):
    """More mass (or less) at some place of the payload, in some trials or growing from the start of every trial.

    The columns are the ten of a rigid body: mass at the payload's centre, its first moment about that, and its inertia
    beyond that of a point. The shape says in which trials, and over which time as much comes to it.
    """

    title = "payload whose mass changes"
    family = "payload_mass"
    parameters = (
        "mass_kg",
        *(f"moment_{axis}_kgm" for axis in "xyz"),
        *(f"inertia_{ij}_kgm2" for ij in INERTIAS),
    )
    scales = (0.01, *(0.003,) * 3, *(0.001,) * 6)  # 10 g at 0.3 m
    at = "payload"
    shapes = (
        {"over_s": constants.MASS_OVER_S},
        *({"trial": float(first), "last_trial": 0.0} for first in range(2, MASS_TRIALS + 1)),
        *(
            {"trial": float(first), "last_trial": float(last)}
            for last in range(2, MASS_SPANS)
            for first in range(2, last + 1)
        ),
    )
    separate = "A scale: the payload is weighed before and after every trial."

    def sentence(self, n):
        at = f"{n.vector('point', 'm')} in {{1}}"
        if n.values["rate_kgps"]:
            gains = n.either("rate_kgps", "gains", "loses")
            return f"the payload {gains} {n('rate_kgps', 'g/s', 1e3)} in every trial, at {at}"
        first, last = int(n.values["trial"]), int(n.values["last_trial"])
        trials = f"from trial {first} on" if not last else f"in trials {first} to {last}"
        trials = f"in trial {first} only" if first == last else trials
        heavier = n.either("mass_kg", "heavier", "lighter")
        return f"{trials} the payload is {heavier} by {n('mass_kg', 'kg')}, at {at}"

    def columns(self, trial, robot, joint, shape):
        Y = balance(trial.data, trial.shared)[1]
        if "over_s" in shape:
            Y = Y * (trial.signals.time / shape["over_s"])[:, None, None]
        Y = Y @ _ten_columns(trial.shared.pi[1:4] / trial.shared.pi[0])
        return trial.of_wrench(-Y[:, :3], -Y[:, 3:])  # the payload pushes back

    def physical(self, values, context):
        mass = values[0] if abs(values[0]) > 1e-6 else 1e-6
        point = context.p_1c + values[1:4] / mass
        pi = _ten_columns(context.p_1c) @ values
        own = inertia_parameters(inertia_matrix(pi[4:] / mass) - _of_point(point))
        over, shape = context.shape.get("over_s"), context.shape
        return (
            {"mass_kg": 0.0 if over else float(mass), "rate_kgps": float(mass / over) if over else 0.0}
            | {"trial": int(shape.get("trial", 1)), "last_trial": int(shape.get("last_trial", 0))}
            | {f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)}
            | {f"inertia_{ij}_m2": float(x) for ij, x in zip(INERTIAS, own, strict=True)}
        )


def _ten_columns(com: Array) -> Array:
    """Inertial parameters (m, m c, J about {1}) of one unit of each parameter, shape (10, 10)."""
    pi = np.eye(10)
    pi[1:4, 0], pi[4:, 0] = com, inertia_parameters(_of_point(com))
    for k, axis in enumerate(np.eye(3)):
        pi[4:, 1 + k] = inertia_parameters(
            2.0 * com[k] * np.eye(3) - np.outer(com, axis) - np.outer(axis, com)
        )
    return pi


def _of_point(r: Array) -> Array:
    """Inertia about {1} of 1 kg at a point of {1} [m], shape (3, 3)."""
    return np.asarray(r @ r * np.eye(3) - np.outer(r, r))
