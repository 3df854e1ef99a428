"""How far a well-kept Omnid may be from its model without that being news: standard deviations per parameter."""

from __future__ import annotations

from pathlib import Path

from discrepancy.causes import tolerances_file

# Standard deviation, and a typical size where the tolerance is zero. Assumed, like the robot's masses: a calibrated
# unit with 16-bit encoders; a lab replaces them by its own (--tolerances).
DEFAULTS: dict[str, dict[str, float]] = {
    "phi_zero": {"zero_rad": 1e-4},
    "theta_zero": {"zero_rad": 1e-4},
    "link_length": {"proximal_m": 2e-5, "rod_m": 2e-5, "base_radius_m": 2e-5},
    "base_tilt": {"roll_rad": 1e-4, "pitch_rad": 1e-4},
    "base_creep": {"x_mps": 2e-8, "y_mps": 2e-8},
    "base_compliance": {"compliance_m_per_N": 1e-7},
    "sea_scale": {"scale": 1e-3},
    "sea_bias": {"bias_Nm": 3e-3},
    "sea_hardening": {"cubic_Nm_per_rad3": 3.0},
    "sea_hysteresis": {"friction_Nm": 2e-3},
    "joint_friction": {"coulomb_Nm": 2e-3, "viscous_Nms_per_rad": 2e-3},
    "gimbal_friction": {"coulomb_Nm": 2e-3, "viscous_Nms_per_rad": 2e-3},
    "torque_skew": {"delay_s": 1e-4},
    "torque_lag": {"time_constant_s": 1e-4},
    "clock_delay": {"delay_s": 1e-5},
    "grasp_flex": {"compliance_m_per_N": 1e-7},
    "grasp_play": {"play_m": 3e-6},
    "drag": {"coefficient_Ns_per_m": 0.05},
    # Friction within tolerance takes another value at every rest, which is a small push while it lasts.
    "push": {f"force_{axis}_N": 0.02 for axis in "xyz"} | {f"moment_{axis}_Nm": 0.02 for axis in "xyz"},
}


def read_tolerances(path: Path | None) -> dict[str, dict[str, float]]:
    """The defaults, with what a TOML file changes; see ``discrepancy.causes.tolerances_file``.

    Raises:
        InputError: the file cannot be read, or names something unknown, or a value is not a number of at least 0.
    """
    return tolerances_file.read_tolerances(path, DEFAULTS)
