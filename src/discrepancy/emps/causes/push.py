"""Something pushed the carriage for a while."""

from discrepancy.emps.causes.base import Cause, force


class Push(Cause):
    """A constant outside force on the carriage during an interval of one block."""

    title = "push on the carriage"
    family = "push"
    parameters = ("force_N",)
    transient = True
    scales = (1.0,)
    separate = "The same motion again: a push does not repeat."

    def sentence(self, n):
        return (
            f"something pushed with {n('force_N', 'N', signed=True)} from {n.values['start_s']:.3f} s on for "
            f"{n.values['duration_s']:.3f} s"
        )

    def columns(self, signals, shape):
        time = signals.log.time
        inside = (time >= shape["start_s"]) & (time < shape["start_s"] + shape["duration_s"])
        return force(-inside.astype(float))
