"""A base that creeps over the floor."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack


class BaseCreep(Cause):
    """The base moves at constant velocity (x, y in its own axes) during a trial."""

    title = "creep of {base}"
    family = "base_creep"
    parameters = ("x_mps", "y_mps")
    tolerances = (2e-8, 2e-8)
    at = "robot"
    separate = "A longer recording at rest."

    def sentence(self, n):
        return (
            f"the base creeps over the floor, by {n('x_mps', 'um/min', 6e7, signed=True)} along its x axis and "
            f"{n('y_mps', 'um/min', 6e7, signed=True)} along its y axis"
        )

    def columns(self, trial, robot, joint, shape):
        time = trial.signals.time - trial.signals.time[0]
        return stack(
            [
                trial.of_pose(robot, None, np.outer(time, trial.bases.R[robot] @ np.eye(3)[k]))
                for k in range(2)
            ]
        )
