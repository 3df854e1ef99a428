"""The catalogue: one file per cause."""

from discrepancy.emps.causes.asymmetric_coulomb import AsymmetricCoulomb
from discrepancy.emps.causes.asymmetric_viscous import AsymmetricViscous
from discrepancy.emps.causes.backlash import Backlash
from discrepancy.emps.causes.base import Cause
from discrepancy.emps.causes.coulomb_friction import CoulombFriction
from discrepancy.emps.causes.delay import Delay
from discrepancy.emps.causes.force_offset import ForceOffset
from discrepancy.emps.causes.injected_force import InjectedForce
from discrepancy.emps.causes.injected_voltage import InjectedVoltage
from discrepancy.emps.causes.mass import Mass
from discrepancy.emps.causes.position_force import PositionForce
from discrepancy.emps.causes.position_gain import PositionGain
from discrepancy.emps.causes.push import Push
from discrepancy.emps.causes.stribeck import Stribeck
from discrepancy.emps.causes.velocity_gain import VelocityGain
from discrepancy.emps.causes.velocity_lag import VelocityLag
from discrepancy.emps.causes.viscous_friction import ViscousFriction

CAUSES: dict[str, Cause] = {
    cause.name: cause()
    for cause in (
        Mass, CoulombFriction, ViscousFriction, AsymmetricCoulomb, AsymmetricViscous, Stribeck, ForceOffset,
        PositionForce, Backlash, Delay, PositionGain, VelocityGain, VelocityLag, InjectedVoltage, InjectedForce, Push,
    )
}  # fmt: skip
"""Every cause by its name, in the order of the documentation."""
