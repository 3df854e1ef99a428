"""Names of all causes: to know them takes nothing that their traces need."""

from collections.abc import Collection, Iterable

from estimator.errors import InputError

TEAM = (
    "phi_zero",
    "theta_zero",
    "link_length",
    "base_tilt",
    "base_creep",
    "base_compliance",
    "sea_scale",
    "sea_bias",
    "sea_hardening",
    "sea_hysteresis",
    "joint_friction",
    "gimbal_friction",
    "torque_skew",
    "torque_lag",
    "sensor_lag",
    "clock_delay",
    "grasp_flex",
    "grasp_play",
    "tether",
    "payload_tether",
    "push",
    "drag",
    "slosh",
    "payload_mass",
)
"""Of a team, in the order of the documentation: those of ``discrepancy.team.causes``."""

JOINTS = (
    "friction",
    "asymmetric_coulomb",
    "asymmetric_viscous",
    "stribeck",
    "sublinear_friction",
    "load_friction",
    "warming",
    "back_emf",
    "coupled_drive",
    "armature",
    "torque_offset",
    "torque_scale",
    "torque_delay",
    "joint_zero",
    "ripple",
    "spring",
    "counterbalance",
    "elasticity",
    "payload",
    "link_mass",
    "link_com",
    "link_inertia",
    "link_length",
    "gravity_direction",
    "gravity_compensation",
    "push",
)
"""Of a robot of joints, as the tables of ``discrepancy.joints.causes`` have them."""


def excluded_from(catalogue: Collection[str], names: Iterable[str]) -> frozenset[str]:
    """The names, all of them in the catalogue.

    Raises:
        InputError: one is not.
    """
    for name in sorted(set(names) - set(catalogue)):
        raise InputError(f"cause {name!r} does not exist; the causes are {', '.join(catalogue)}")
    return frozenset(names)
