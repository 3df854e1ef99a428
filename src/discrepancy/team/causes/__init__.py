"""The catalogue: one file per cause."""

from discrepancy.team.causes.base import Cause
from discrepancy.team.causes.base_compliance import BaseCompliance
from discrepancy.team.causes.base_creep import BaseCreep
from discrepancy.team.causes.base_tilt import BaseTilt
from discrepancy.team.causes.clock_delay import ClockDelay
from discrepancy.team.causes.drag import Drag
from discrepancy.team.causes.gimbal_friction import GimbalFriction
from discrepancy.team.causes.grasp_flex import GraspFlex
from discrepancy.team.causes.grasp_play import GraspPlay
from discrepancy.team.causes.joint_friction import JointFriction
from discrepancy.team.causes.link_length import LinkLength
from discrepancy.team.causes.phi_zero import PhiZero
from discrepancy.team.causes.push import Push
from discrepancy.team.causes.sea_bias import SeaBias
from discrepancy.team.causes.sea_hardening import SeaHardening
from discrepancy.team.causes.sea_hysteresis import SeaHysteresis
from discrepancy.team.causes.sea_scale import SeaScale
from discrepancy.team.causes.slosh import Slosh
from discrepancy.team.causes.tether import Tether
from discrepancy.team.causes.theta_zero import ThetaZero
from discrepancy.team.causes.torque_lag import TorqueLag
from discrepancy.team.causes.torque_skew import TorqueSkew

CAUSES: dict[str, Cause] = {
    cause.name: cause()
    for cause in (
        PhiZero, ThetaZero, LinkLength, BaseTilt, BaseCreep, BaseCompliance, SeaScale, SeaBias, SeaHardening,
        SeaHysteresis, JointFriction, GimbalFriction, TorqueSkew, TorqueLag, ClockDelay, GraspFlex, GraspPlay,
        Tether, Push, Drag, Slosh,
    )
}  # fmt: skip
"""Every cause by its name, in the order of the documentation."""
