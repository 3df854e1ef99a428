"""Causes at the payload: pushes, drag, and changes of its mass."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from discrepancy.candidate import Transient
from discrepancy.team.causes.base import Cause, Shape, by_axis, stack
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import ORDER, Array, inertia_matrix, inertia_parameters, point_inertia
from estimator.rigid_team import balance, fusion_matrix

MASS_OVER_S = 60.0
"""Time in which a drifting mass changes by one unit of its columns [s]. Chosen."""

TEAM_PUSH_EDGE_S = 0.05
"""Step of finite differences by ends and ramps of a push [s]. Chosen: rows are 0.08 s apart."""


PUSH_RAMPS = (0.25, 0.8)
"""Ramps of a push over its length at half height, tried first. Chosen: Gauss-Newton steps refine them."""


def during(trial: TrialLinear, shape: Shape) -> Array:
    """Strength of a push at each sample: 1 within its interval, less on its ramps, 0 outside, shape (Q,).

    The mean over each sample period resolves ends that lie between samples.
    """
    each = 1.0 / trial.signals.rate_hz
    edges = np.append(trial.signals.time - 0.5 * each, trial.signals.time[-1] + 0.5 * each)
    return np.asarray(np.diff(Transient(0, **shape).acted(edges)) / each, dtype=np.float64)


class Push(Cause):
    """A force (in {b1}) at a payload point, expressed as force and moment at the origin of {1}."""

    title = "push on the payload"
    family = "push"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "moment_x_Nm", "moment_y_Nm", "moment_z_Nm")
    tolerances = (0.02,) * 6  # friction that settles differently acts like a small push
    transient = True
    determined = dict.fromkeys(("start_s", "duration_s", "ramp_s"), 0.25)
    at = "payload"
    separate = "Another trial: a push does not repeat."

    def sentence(self, n):
        ramp = f", {n('ramp_s', 's')} of it to grow and as much to fade" if n.values.get("ramp_s") else ""
        return (
            f"something pushed the payload in trial {n.values['trial']:.0f} from {n('start_s', 's')} on for "
            f"{n('duration_s', 's')}{ramp}, with {n.vector('force', 'N')} along a line "
            f"through {n.vector('point', 'm')} in {{1}}"
        )

    def slope_step(self, name, number):
        most = TEAM_PUSH_EDGE_S
        return most if name == "start_s" else min(most, super().slope_step(name, number))

    def finer(self, shape):
        """The same length at half height, with ramps."""
        ramps = [] if shape.get("ramp_s") else [share * shape["duration_s"] for share in PUSH_RAMPS]
        return [
            {"start_s": shape["start_s"] - 0.5 * r, "duration_s": shape["duration_s"] + r, "ramp_s": r}
            for r in ramps
        ]

    def columns(self, trial, robot, joint, shape):
        window = during(trial, shape)
        none = np.zeros((len(window), 3))
        forces = [
            trial.of_wrench(along * window[:, None], none)
            for along in np.moveaxis(trial.data.R_bi[:, 0], 1, 0)
        ]
        moments = [trial.of_wrench(none, np.outer(window, axis)) for axis in np.eye(3)]
        return stack([*forces, *moments])

    def physical(self, values, context):
        force, moment = values[:3], values[3:]
        # Only the line of action is observable; report its point nearest to the centre of mass.
        lever = np.cross(force, moment - np.cross(context.p_1c, force)) / max(force @ force, 1e-12)
        point = context.p_1c + lever
        return (
            {"trial": context.trial or 1, "start_s": context.shape["start_s"]}
            | {"duration_s": context.shape["duration_s"], "ramp_s": context.shape.get("ramp_s", 0.0)}
            | by_axis("force", "N", force) | by_axis("point", "m", point)
        )  # fmt: skip


class Drag(Cause):
    """Force -c v on the payload at its centre of mass, and a moment -c_r omega.

    With ``powers`` of two in its shape, also -q |v| v and -q_r |omega| omega, like air and water. Both may act.
    """

    title = "drag on the payload"
    family = "dissipation"
    parameters = (
        "coefficient_Ns_per_m", "turning_Nms_per_rad", "quadratic_Ns2_per_m2", "turning_quadratic_Nms2_per_rad2",
    )  # fmt: skip
    # The first covers a plate of 0.4 m^2 in air at 0.2 m/s, a typical carrying speed; the second is the first at half
    # a metre. The quadratic ones are equal to these at 1 m/s and 1 rad/s.
    tolerances = (0.05, 0.01, 0.05, 0.01)
    at = "payload"
    positive: ClassVar = parameters
    clipped: ClassVar = parameters
    separate = "Translation at constant attitude separates drag of the payload from friction of the gimbals."

    def sentence(self, n):
        squares = ""
        if n.values.get("quadratic_Ns2_per_m2") or n.values.get("turning_quadratic_Nms2_per_rad2"):
            squares = (
                f", and with the squares of their speeds by {n('quadratic_Ns2_per_m2', 'N s^2/m^2')} and "
            )
            squares += n("turning_quadratic_Nms2_per_rad2", "N m s^2/rad^2")
        return (
            f"the payload's motion is resisted by {n('coefficient_Ns_per_m', 'N s/m', signed=True)}, its turning by "
            f"{n('turning_Nms_per_rad', 'N m s/rad', signed=True)}{squares}"
        )

    def further(self, shape):
        return [] if shape else [{"powers": 2.0}]

    def columns(self, trial, robot, joint, shape):
        motion = trial.motion
        twist: Array = trial.data.twist.reshape(len(trial.s), -1) @ fusion_matrix(trial.shared.grasps).T
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        velocity = np.asarray(twist[:, 3:] + np.cross(motion.omega, com), dtype=np.float64)
        still = np.zeros_like(velocity)

        def resisting(velocity: Array, omega: Array) -> Array:
            moment = np.asarray(-np.cross(com, velocity) - omega, dtype=np.float64)
            return trial.of_wrench(-velocity, moment)

        columns = [resisting(velocity, still), resisting(still, motion.omega)]
        if not shape:
            return stack([*columns, *(np.zeros_like(c) for c in columns)])
        return stack(
            [*columns, resisting(_squared(velocity), still), resisting(still, _squared(motion.omega))]
        )


def _squared(v: Array) -> Array:
    """|v| v, shape (Q, 3)."""
    return np.linalg.norm(v, axis=1)[:, None] * v


MASS_SPANS = 5
"""Number of trials within which every span of trials is a shape. Chosen: a later change of mass can only be lasting."""

MASS_TRIALS = 12
"""Last trial in which a mass change may begin. Chosen: longer series are logs, not experiments."""

INERTIAS = tuple("xyz"[i] + "xyz"[j] for i, j in ORDER)


class PayloadMass(Cause):
    """Additional or missing mass at a point of the payload, in some trials or growing from the start of every trial.

    The columns are the ten inertial parameters: mass at the payload's centre, first moment about that, and inertia
    beyond that of a point. The shape says in which trials, or in which time one unit is added.
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
        {"over_s": MASS_OVER_S},
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
        own = inertia_parameters(inertia_matrix(pi[4:] / mass) - point_inertia(point))
        over, shape = context.shape.get("over_s"), context.shape
        return (
            {"mass_kg": 0.0 if over else float(mass), "rate_kgps": float(mass / over) if over else 0.0}
            | {"trial": int(shape.get("trial", 1)), "last_trial": int(shape.get("last_trial", 0))}
            | by_axis("point", "m", point)
            | {f"inertia_{ij}_m2": float(x) for ij, x in zip(INERTIAS, own, strict=True)}
        )


def _ten_columns(com: Array) -> Array:
    """Inertial parameters (m, m c, J about {1}) per unit of each parameter, shape (10, 10)."""
    pi = np.eye(10)
    pi[1:4, 0], pi[4:, 0] = com, inertia_parameters(point_inertia(com))
    for k, axis in enumerate(np.eye(3)):
        pi[4:, 1 + k] = inertia_parameters(
            2.0 * com[k] * np.eye(3) - np.outer(com, axis) - np.outer(axis, com)
        )
    return pi
