"""One robot's clock."""

from discrepancy.team.causes.base import Cause, one_robot, stack
from discrepancy.team.causes.shift import advanced
from discrepancy.team.linear.signals import with_rates


class ClockDelay(Cause):
    """Everything a robot logs is that of ``delay_s`` ago."""

    name = "clock_delay"
    family = "clock"
    parameters = ("delay_s",)
    tolerances = (1e-5,)
    at = "robot"
    separate = "Fast motion of all robots at once."

    def sentence(self, n):
        return f"all that it logs is {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"

    def columns(self, trial, robot, joint, shape):
        s, rate = trial.signals, trial.signals.rate_hz
        parts = [-with_rates(x[:, robot], rate)[1] for x in (s.phi, s.theta, s.tau)]
        return stack([trial.of_signals(robot, *parts)])

    def undo(self, signals, trial, robot, joint, values, shape):
        late = [
            one_robot(x[:, robot] - advanced(x[:, robot], signals.rate_hz, values[0]), trial.robots, robot)
            for x in (signals.phi, signals.theta, signals.tau)
        ]
        return signals.minus(*late)
