"""Robots as they are in plain JSON, units in the keys' suffixes; strict both ways."""

from __future__ import annotations

from typing import Any

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, GROUPS, ArmUnit, Group
from estimator.errors import InputError
from estimator.strict import Fields


def key_of(group: Group) -> str:
    """The group's name with its unit, such as ``tau_zero_Nm``."""
    return f"{group.name}_{group.unit.replace(' ', '')}" if group.unit else group.name


KEYS = tuple(key_of(group) for group in GROUPS)


def units_to_list(units: ArmUnit) -> list[dict[str, list[float]]]:
    """One object per robot: every group of ``GROUPS`` as a list of its entries.

    Args:
        units: ``x`` of shape (N, ``COUNT``).
    """
    return [
        {key_of(group): one.of(group.name).tolist() for group in GROUPS}
        for one in (ArmUnit(units.design, x) for x in units.x)
    ]


def units_from_list(values: list[Any], design: OmnidDesign, where: str) -> ArmUnit:
    """Inverse of ``units_to_list``.

    Args:
        values: one object per robot.
        design: what the robots deviate from.
        where: what messages call the list.

    Raises:
        InputError: a key is unknown or missing, or a value is not finite, or not such that an arm can have it.
    """
    x = np.empty((len(values), COUNT))
    for i, entry in enumerate(values):
        read = Fields(entry, KEYS, f"{where}[{i}]")
        x[i] = np.concatenate([read.array(key_of(group), (len(group.entries),)) for group in GROUPS])
    units = ArmUnit(design, x)
    check_units(units, where)
    return units


def check_units(units: ArmUnit, where: str) -> None:
    """Whether such arms can be: lengths and masses, and the springs' stiffness, are greater than 0.

    Raises:
        InputError: they cannot.
    """
    for group, least in (("stiffness_ratio", -1.0), ("proximal_mass_ratio", -1.0), ("rod_mass_ratio", -1.0),
                         ("wrist_mass_ratio", -1.0), ("radius", -units.design.radius_m),
                         ("proximal_length", -units.design.proximal_length_m),
                         ("rod_length", -units.design.rod_length_m)):  # fmt: skip
        values = units.of(group)
        bad = np.argwhere(~(values > least))
        if len(bad):
            robot, value = int(bad[0][0]), float(values[tuple(bad[0])])
            key = KEYS[[one.name for one in GROUPS].index(group)]
            raise InputError(f"{where}[{robot}]: {key} is {value:g}; it must be greater than {least:g}")
