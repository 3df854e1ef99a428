"""One robot's clock."""

from discrepancy.team.causes.shift import Late


class ClockDelay(Late):
    """Everything a robot logs is that of ``delay_s`` ago."""

    title = "clock delay of {robot}"
    family = "clock"
    tolerances = (1e-5,)
    readings = ("phi", "theta", "tau")
    by_clocks = True
    separate = "Fast motion of all robots at once."

    def sentence(self, n):
        return f"all that it logs is {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"
