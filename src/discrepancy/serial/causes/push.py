"""Something pushed the arm for a while."""

from discrepancy.serial.causes.base import Cause


class Push(Cause):
    """A constant outside force on the last link during an interval of one block."""

    title = "push on the last link"
    family = "push"
    part = "arm"
    parameters = ("force_x_N", "force_y_N", "force_z_N")
    scales = (1.0, 1.0, 1.0)
    transient = True
    separate = "The same motion again: a push does not repeat."

    def sentence(self, n):
        return (
            f"something pushed the last link with {n.vector('force', 'N')} from {n.values['start_s']:.3f} s on for "
            f"{n.values['duration_s']:.3f} s"
        )

    def columns(self, signals, at, shape):
        time = signals.time
        inside = (time >= shape["start_s"]) & (time < shape["start_s"] + shape["duration_s"])
        # What helps the motion spares the motors as much.
        return -signals.pushed * inside[:, None, None].astype(float)
