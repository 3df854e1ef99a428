"""A base that gives way to the horizontal force on it."""

from typing import ClassVar

import numpy as np

from discrepancy.team.causes.base import stack
from discrepancy.team.causes.yielding import Yielding, lagging

BASE_INERTIA_SHARES, BASE_INERTIA_FINER = (0.06, 0.25, 1.0), (0.5, 0.7, 1.4, 2.0)
"""Compliance times the mass that moves, over the square of the lag, tried where a base gives way: a quarter is damped
critically; and shares of it tried next. Chosen."""


class BaseCompliance(Yielding):
    """The base gives way to the horizontal force, which is the reaction to arm and payload.

    Where it gives way much the robot's own mass shows: on 14 um/N, 70 kg swing at 5 Hz.
    """

    title = "compliance of {base}"
    at = "robot"
    determined: ClassVar = {**Yielding.determined, "inertia_s2": 0.1}
    separate = (
        "Vertical forces (lifting against each other) separate a base, which yields sideways, from a grasp."
    )

    def sentence(self, n):
        along = f", {n('mass_kg', 'kg')} moving along" if n.values.get("mass_kg") else ""
        return (
            f"the base gives way horizontally, by {n('compliance_m_per_N', 'um/N', 1e6)}, and follows the force within "
            f"{n('relaxation_s', 'ms', 1e3)}{along}"
        )

    def finer(self, shape):
        times = super().finer(shape)
        if "inertia_s2" not in shape:
            return times
        inertias = (shape["inertia_s2"] * share for share in BASE_INERTIA_FINER)
        return [*({**shape, **time} for time in times), *({**shape, "inertia_s2": x} for x in inertias)]

    def further(self, shape):
        """With the robot's mass on the spring; the same lag where forces are slow."""
        if "inertia_s2" in shape:
            return []
        shares = BASE_INERTIA_SHARES
        return [{**shape, "inertia_s2": share * shape["relaxation_s"] ** 2} for share in shares]

    def physical(self, values, context):
        given = super().physical(values, context)
        inertia_s2 = given.pop("inertia_s2", 0.0)
        return {**given, "mass_kg": inertia_s2 / (given["compliance_m_per_N"] or np.inf)}

    def columns(self, trial, robot, joint, shape):
        mass_kg = trial.design.wrist_mass_kg + 1.5 * trial.design.rod_mass_kg
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        force = force + mass_kg * trial.wrist_accelerations[:, robot]
        horizontal = lagging(-force * np.array([1.0, 1.0, 0.0]), trial.signals.rate_hz, shape)
        return stack([trial.of_pose(robot, None, horizontal @ trial.bases.R[robot].T)])
