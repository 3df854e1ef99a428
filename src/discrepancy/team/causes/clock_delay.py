"""One robot's clock."""

import numpy as np

from discrepancy.team.causes.shift import Late


class ClockDelay(Late):
    """Everything a robot logs is that of ``delay_s`` ago.

    All robots' clocks late by as much is nothing: what else is off in the model is made of the same readings, and
    late, too. Taken one by one they would shift the residual against that. So a column is what one robot's delay adds
    less what a delay of all does, an N-th of it each.
    """

    title = "clock delay of {robot}"
    family = "clock"
    tolerances = (1e-5,)
    readings = ("phi", "theta", "tau")
    by_clocks = True
    separate = "Fast motion of all robots at once."

    def sentence(self, n):
        return f"all that it logs is {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"

    def columns(self, trial, robot, joint, shape):
        each = [super(ClockDelay, self).columns(trial, i, joint, shape) for i in range(trial.robots)]
        return each[robot] - np.mean(each, axis=0)
