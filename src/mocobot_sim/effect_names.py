"""Names of all effects, so that a wrong name can be rejected without loading MuJoCo."""

import difflib

from estimator.errors import InputError

NAMES = (
    "phi_zero",
    "theta_zero",
    "zero_scatter",
    "encoder_play",
    "link_length",
    "base_tilt",
    "base_creep",
    "base_compliance",
    "grasp_flex",
    "grasp_play",
    "sea_bias",
    "sea_scale",
    "sea_hardening",
    "sea_hysteresis",
    "joint_friction",
    "gimbal_friction",
    "torque_skew",
    "torque_lag",
    "sensor_lag",
    "clock_delay",
    "tether",
    "payload_tether",
    "push",
    "drag",
    "slosh",
    "payload_mass",
    "law",
)
"""Names of the effects in the order in which they are listed; each is a class in ``mocobot_sim.effects``."""


def check_effect_name(name: str) -> None:
    """Check the name of an effect.

    Raises:
        InputError: there is no such effect.
    """
    if name not in NAMES:
        close = difflib.get_close_matches(name, NAMES, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"the effects are {', '.join(NAMES)}"
        raise InputError(f"effect {name!r} does not exist; {hint}")
