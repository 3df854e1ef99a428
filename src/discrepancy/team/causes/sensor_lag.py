"""A first-order lag inside a single torque sensor."""

from discrepancy.team.causes.base import ReadingError, one_joint


class SensorLag(ReadingError):
    """One torque lags by a first-order filter, which the controller sees as well."""

    title = "lag of the torque sensor in {driven joint}"
    family = "dissipation"
    parameters = ("time_constant_s",)
    tolerances = (1e-4,)
    positive = ("time_constant_s",)
    separate = "The commands separate a lag inside the sensor from a late log."

    def sentence(self, n):
        return f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"

    def errors(self, signals, robot, joint, shape, design):
        # truth = reading + T d(reading)/dt
        return [{"tau": -one_joint(signals.with_rates(signals.tau[:, robot, joint])[1], joint)}]
