"""Names of all causes, without the imports of their models, and files of tolerances."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from estimator.errors import InputError
from estimator.strict import is_number, read_toml

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
    "encoder_play",
)
"""Causes of a team in the order of the documentation, as in ``discrepancy.team.causes``."""

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
    "backlash",
    "soft_stand",
    "payload",
    "link_mass",
    "link_com",
    "link_inertia",
    "link_length",
    "gravity_direction",
    "gravity_compensation",
    "push",
)
"""Causes of a robot of joints, as in ``discrepancy.joints.causes``."""


def excluded_from(catalogue: Collection[str], names: Iterable[str]) -> frozenset[str]:
    """Check that all names are in the catalogue, and return them.

    Raises:
        InputError: a name is not in the catalogue.
    """
    for name in sorted(set(names) - set(catalogue)):
        raise InputError(f"cause {name!r} does not exist; the causes are {', '.join(catalogue)}")
    return frozenset(names)


def read_tolerances(
    path: Path | None, defaults: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """Read tolerances from a TOML file with tables ``[cause]`` and keys ``parameter = value``; the rest are defaults.

    Args:
        path: the file, or None.
        defaults: standard deviations by cause and parameter.

    Raises:
        InputError: the file cannot be read, contains an unknown name, or a value is not a number of at least 0.
    """
    tolerances = {cause: dict(values) for cause, values in defaults.items()}
    if path is None:
        return tolerances
    for cause, values in read_toml(path, "file of tolerances").items():
        if cause not in tolerances or not isinstance(values, Mapping):
            raise InputError(f"{path}: unknown table {cause!r}; the causes are {', '.join(tolerances)}")
        for name, value in values.items():
            if name not in tolerances[cause]:
                raise InputError(
                    f"{path}: {cause} has no {name!r}; its parameters are {', '.join(tolerances[cause])}"
                )
            if not is_number(value) or not 0 <= value < 1e6:
                raise InputError(f"{path}: {cause}.{name} is {value!r}; it must be a number of at least 0")
            tolerances[cause][name] = float(value)
        zeros = [name for name, value in tolerances[cause].items() if value == 0]
        if zeros and len(zeros) < len(tolerances[cause]):
            raise InputError(
                f"{path}: {cause}.{zeros[0]} is 0; either all parameters of a cause have a tolerance or none "
                f"({', '.join(tolerances[cause])})"
            )
    return tolerances
