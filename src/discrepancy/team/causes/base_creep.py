"""A base that creeps over the floor."""

from typing import ClassVar

import numpy as np

from discrepancy.team.causes.base import Cause, stack

CREEP_STARTS = 100
"""How many of them there are, each as likely as the others. Derived: three bases, by a minute in steps of 2 s."""

CREEP_STEP_S = 0.5
"""Step of slopes by that time. Chosen: what creeps from half a second sooner or later goes nearly the same way."""

CREEP_FINER_S = (-2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0)
"""By which such a time is moved next. Chosen."""

CREEP_STARTS_S = tuple(3.0 * k for k in range(1, 31))
"""Into a trial, at which a base may begin to creep, tried first. Chosen: trials last less than a minute and a half."""


class BaseCreep(Cause):
    """The base moves at constant velocity (x, y in its own axes) during a trial; with ``start_s`` from then on only."""

    title = "creep of {base}"
    family = "base_creep"
    parameters = ("x_mps", "y_mps")
    tolerances = (2e-8, 2e-8)
    at = "robot"
    determined: ClassVar = {"start_s": CREEP_STEP_S}
    separate = "A longer recording at rest."

    def sentence(self, n):
        start = f" from {n('start_s', 's')} into a trial" if n.values.get("start_s") else ""
        return (
            f"the base creeps over the floor{start}, by {n('x_mps', 'um/min', 6e7, signed=True)} along its x axis and "
            f"{n('y_mps', 'um/min', 6e7, signed=True)} along its y axis"
        )

    def further(self, shape):
        return [] if shape else [{"start_s": start_s} for start_s in CREEP_STARTS_S]

    def finer(self, shape):
        starts_s = [shape["start_s"] + x for x in CREEP_FINER_S] if shape else []
        return [{"start_s": start_s} for start_s in starts_s if start_s > 0.0]

    def alike(self, shape):
        return CREEP_STARTS if shape else self.among

    def slope_step(self, name, number):
        return self.determined[name]

    def physical(self, values, context):
        return super().physical(values, context) | {"start_s": context.shape.get("start_s", 0.0)}

    def columns(self, trial, robot, joint, shape):
        # From the recording's begin, of which this may be a later part; a constant way is the bases' own.
        since = shape.get("start_s", trial.signals.time[0])
        time = np.maximum(0.0, trial.signals.time - since)
        return stack(
            [
                trial.of_pose(robot, None, np.outer(time, trial.bases.R[robot] @ np.eye(3)[k]))
                for k in range(2)
            ]
        )
