"""Names of the axis' causes, each that of its file in ``discrepancy.emps.causes``."""

NAMES = (
    "mass",
    "coulomb_friction",
    "viscous_friction",
    "asymmetric_coulomb",
    "asymmetric_viscous",
    "stribeck",
    "force_offset",
    "position_force",
    "backlash",
    "delay",
    "position_gain",
    "velocity_gain",
    "velocity_lag",
    "injected_voltage",
    "injected_force",
    "push",
)
"""In the order of the documentation."""
