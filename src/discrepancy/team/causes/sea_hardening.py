"""A spring that grows stiffer with deflection."""

from discrepancy.team.causes.base import ReadingError, one_joint


class SeaHardening(ReadingError):
    """Torque k d + k3 d^3 of deflection d, read as k d."""

    title = "hardening of the spring of {driven joint}"
    family = "sea_torque"
    parameters = ("cubic_Nm_per_rad3",)
    tolerances = (3.0,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        hardens = n.either("cubic_Nm_per_rad3", "hardens", "softens")
        return f"the spring {hardens} with its deflection, by {n('cubic_Nm_per_rad3', 'N m/rad^3')} (cubic)"

    def errors(self, signals, robot, joint, shape, design):
        deflection = signals.tau[:, robot, joint] / design.sea_stiffness_Nm_per_rad
        return [{"tau": one_joint(-(deflection**3), joint)}]
