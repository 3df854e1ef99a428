"""Torques that are logged later than the angles."""

from discrepancy.team.causes.shift import Late


class TorqueSkew(Late):
    """All torques of a robot are those of ``delay_s`` ago; only the log is late, the controller is not."""

    title = "late torque log of {robot}"
    family = "dissipation"
    tolerances = (1e-4,)
    separate = "The commands separate a late log from a lag inside the sensor, which the controller sees too."

    def sentence(self, n):
        return f"the torques are logged {n('delay_s', 'ms', 1e3, signed=True)} later than the angles"
