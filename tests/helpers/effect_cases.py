"""One plausible effect of every cause, and the same at zero size."""

from pathlib import Path
from typing import Any

from mocobot_sim.effects import EFFECTS, Effect, apply_effects, make_effect
from mocobot_sim.scene.scene import TeamScene, build_team
from payload_mjcf import ONE

SIZES: dict[str, dict[str, Any]] = {
    "phi_zero": {"zero_rad": 1e-3},
    "theta_zero": {"zero_rad": 1e-3},
    "zero_scatter": {"phi_rad": 1e-3, "theta_rad": 1e-3, "draw": 0},
    "encoder_play": {"play_rad": 3e-3},
    "link_length": {"proximal_m": 5e-4, "rod_m": 1e-3, "base_radius_m": 1e-3},
    "base_tilt": {"roll_rad": 0.01, "pitch_rad": -0.02},
    "base_creep": {"x_mps": 1e-6, "y_mps": -2e-6, "start_s": 0.0},
    "base_compliance": {"compliance_m_per_N": 1e-6, "relaxation_s": 0.05, "mass_kg": 0.0},
    "grasp_flex": {
        "compliance_m_per_N": 1e-6, "relaxation_s": 0.0, "turning_rad_per_N": 0.0, "offset_m": 0.0,
    },
    "grasp_play": {"play_m": 1e-4, "contact_m_per_N": 0.0},
    "sea_bias": {"bias_Nm": 0.05},
    "sea_scale": {"scale": 0.02},
    "sea_hardening": {"cubic_Nm_per_rad3": 200.0},
    "sea_hysteresis": {"friction_Nm": 0.05, "presliding_Nm": 0.0},
    "joint_friction": {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02, "presliding_rad": 0.0},
    "gimbal_friction": {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02, "presliding_rad": 0.0},
    "torque_skew": {"delay_s": 0.0015},
    "torque_lag": {"time_constant_s": 0.003},
    "sensor_lag": {"time_constant_s": 0.003},
    "clock_delay": {"delay_s": -0.0015},
    "tether": {
        "stiffness_N_per_m": 5.0, "anchor_x_m": 0.1, "anchor_y_m": 0.0, "anchor_z_m": 0.8, "length_m": 0.0,
        "stiffening_N_per_m2": 0.0,
    },
    "payload_tether": {
        "stiffness_N_per_m": 5.0, "anchor_x_m": 0.1, "anchor_y_m": 0.0, "anchor_z_m": 0.8,
        "point_x_m": 0.05, "point_y_m": 0.0, "point_z_m": 0.02, "length_m": 0.0,
        "stiffening_N_per_m2": 0.0,
    },
    "push": {
        "trial": 1, "start_s": 1.0, "duration_s": 0.5, "force_x_N": 3.0, "force_y_N": 0.0, "force_z_N": 1.0,
        "point_x_m": 0.1, "point_y_m": 0.05, "point_z_m": 0.0, "ramp_s": 0.0,
    },
    "drag": {
        "coefficient_Ns_per_m": 2.0, "turning_Nms_per_rad": 0.5, "quadratic_Ns2_per_m2": 0.0,
        "turning_quadratic_Nms2_per_rad2": 0.0,
    },
    "slosh": {
        "mass_kg": 0.3, "length_m": 0.1, "damping_ratio": 0.05, "point_x_m": 0.0, "point_y_m": 0.0, "point_z_m": 0.1,
        "across_length_m": 0.0, "heading_rad": 0.0, "second_length_m": 0.0, "second_share": 0.0,
    },
    "payload_mass": {
        "mass_kg": 0.3, "rate_kgps": 1e-3, "trial": 1, "last_trial": 0, "point_x_m": 0.1, "point_y_m": 0.05,
        "point_z_m": 0.02, "inertia_xx_m2": 2e-3, "inertia_xy_m2": 0.0, "inertia_xz_m2": 1e-4, "inertia_yy_m2": 2e-3,
        "inertia_yz_m2": 0.0, "inertia_zz_m2": 3e-3,
    },
    "law": {
        "target": "tau_1_2", "function": "linear", "of": "tau_1_3", "amplitude": 0.05, "number": 0.0, "second": 0.0,
        "phase_rad": 0.0, "times": "",
    },
}  # fmt: skip
# What makes an effect nothing; places and shapes stay.
SIZE_NAMES = {
    "tether": ("stiffness_N_per_m",),
    "payload_tether": ("stiffness_N_per_m",),
    "push": ("force_x_N", "force_y_N", "force_z_N"),
    "slosh": ("mass_kg",),
    "payload_mass": ("mass_kg", "rate_kgps"),
    "law": ("amplitude",),
}


def example(cause: str, robot: int = 1, joint: int = 2, zero: bool = False, **changes: float) -> Effect:
    """An effect of a cause, with other sizes where given."""
    parameters = SIZES[cause] | changes
    if zero:
        parameters |= dict.fromkeys(SIZE_NAMES.get(cause, tuple(parameters)), 0.0)
    names = EFFECTS[cause].place_names()
    return make_effect(
        cause, parameters, robot if "robot" in names else None, joint if "joint" in names else None
    )


def team_with(payload: str | Path, *effects: Effect, **options) -> TeamScene:
    """A fresh team with effects."""
    return apply_effects(build_team(payload, **options), effects)


def one_robot(folder: Path, *effects: Effect) -> TeamScene:
    """One robot that carries a hanging payload of 3 kg, with effects."""
    return team_with(ONE.write(folder), *effects)
