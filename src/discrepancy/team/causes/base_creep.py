"""A base that creeps over the floor."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack


class BaseCreep(Cause):
    """The base moves at constant velocity (x, y in its own axes) during a trial."""

    name = "base_creep"
    family = "base_creep"
    parameters = ("x_mps", "y_mps")
    per = "robot"
    separate = "A longer recording at rest."

    def columns(self, trial, robot, joint, shape):
        time = trial.signals.time - trial.signals.time[0]
        return stack(
            [
                trial.of_pose(robot, None, np.outer(time, trial.bases.R[robot] @ np.eye(3)[k]))
                for k in range(2)
            ]
        )
