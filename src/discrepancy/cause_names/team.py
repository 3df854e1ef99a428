"""Names of the team's causes, each that of its file in ``discrepancy.team.causes``."""

NAMES = (
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
"""In the order of the documentation."""
