"""A push: a force on the payload during an interval of one trial, constant or with ramps."""

import numpy as np

from discrepancy.candidate import Transient
from discrepancy.team.causes.base import Cause, Shape, stack
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array

TEAM_PUSH_EDGE_S = 0.05
"""Over which slopes by the ends and ramps of a push are taken. Derived: rows are 0.08 s apart. Measured: an end that is
0.1 s off costs 276 of 1483 nats of a push of 0.64 N for 10 s."""


def during(trial: TrialLinear, shape: Shape) -> Array:
    """Share of a push that acts about each sample: 1 within its interval but for the ramps, 0 outside, shape (Q,).

    A mean over the sample's own time, so that ends between samples are told apart.
    """
    each = 1.0 / trial.signals.rate_hz
    edges = np.append(trial.signals.time - 0.5 * each, trial.signals.time[-1] + 0.5 * each)
    return np.asarray(np.diff(Transient(0, **shape).acted(edges)) / each, dtype=np.float64)


class Push(Cause):
    """Force (axes of {b1}) at a payload point, as force and moment at the origin of {1}."""

    title = "push on the payload"
    family = "push"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "moment_x_Nm", "moment_y_Nm", "moment_z_Nm")
    tolerances = (
        0.02,
        0.02,
        0.02,
        0.02,
        0.02,
        0.02,
    )  # friction that rests anew is a small push while it lasts
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

    def columns(self, trial, robot, joint, shape):
        window = during(trial, shape)
        none = np.zeros((len(window), 3))
        columns = []
        for axis in np.eye(3):
            force = np.einsum("qji,j->qi", trial.data.R_bi[:, 0], axis) * window[:, None]
            columns.append(trial.of_wrench(force, none))
        for axis in np.eye(3):
            columns.append(trial.of_wrench(none, np.outer(window, axis)))
        return stack(columns)

    def physical(self, values, context):
        force, moment = values[:3], values[3:]
        # Only the line of action shows; the point on it nearest to the centre of mass is named.
        lever = np.cross(force, moment - np.cross(context.p_1c, force)) / max(force @ force, 1e-12)
        point = context.p_1c + lever
        return (
            {"trial": context.trial or 1, "start_s": context.shape["start_s"]}
            | {"duration_s": context.shape["duration_s"], "ramp_s": context.shape.get("ramp_s", 0.0)}
            | {f"force_{axis}_N": float(x) for axis, x in zip("xyz", force, strict=True)}
            | {f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)}
        )
