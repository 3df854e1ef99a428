"""A calibrated team as a scene: the robots as they are, and what they carry as it was found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.calibrate.calibration import Calibration, Carried, carried
from estimator.errors import InputError
from mocobot_sim.effects.base_tilt import BaseTilt
from mocobot_sim.effects.catalogue import apply_effects
from mocobot_sim.extended.extended import write_extended
from mocobot_sim.scene.as_built import units_as_built
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.payload_mjcf import nearest_inertia, payload_mjcf
from mocobot_sim.scene.scene import TeamScene, build_team

NOISE = 4.0
"""Standard errors by which a principal moment may be moved to be that of a body."""
LEAST_MOMENT_RATIO = 1e-3
"""Of a principal moment to the largest."""


def calibrated_team(
    calibration: Calibration, payload: int = 0, initial: tuple[Array, Array] | None = None
) -> TeamScene:
    """The team as calibrated, where it stood in the first recording of a payload.

    Args:
        calibration: of robots of the simulated design.
        payload: which of the payloads it carries.
        initial: true (phi, theta) near which trials start [rad], two arrays (N, 3); None for home.

    Raises:
        InputError: the robots are of another design, there is no such payload, or its numbers are none of a rigid body.
    """
    if calibration.design != omnid_design():
        raise InputError("the calibrated robots are of another design than the simulated Omnid")
    trial = next((t for t in calibration.trials if t.payload == payload and t.bases is not None), None)
    if trial is None or trial.bases is None:
        raise InputError(f"the calibration has no recording of a payload number {payload + 1}")
    held = calibration.payloads[payload]
    found, grasps = carried(held, calibration.scale_sd), held.grasps
    X_1i = RigidTransform.from_components(grasps.p_1i, Rotation.from_matrix(grasps.R_1i))
    tilts = [
        BaseTilt(robot, *map(float, tilt))
        for robot, tilt in enumerate(calibration.units.of("tilt"), start=1)
        if tilt.any()
    ]
    p = trial.bases.p.copy()
    for tilt in tilts:  # they turn about the mount, below {b}
        p[tilt.robot - 1] -= trial.bases.R[tilt.robot - 1] @ tilt.base_shift()
    scene = build_team(
        payload_mjcf(found.mass_kg, found.p_1c, _of_a_body(found), X_1i),
        units_as_built(calibration.units),
        mounts=RigidTransform.from_components(
            p - [0.0, 0.0, float(np.min(p[:, 2]))], Rotation.from_matrix(trial.bases.R)
        ),
        initial=initial,
    )
    return apply_effects(scene, tilts)


def _of_a_body(found: Carried) -> Array:
    """The inertia that a body can have where noise made it none, as it does of a flat one; else what was found."""
    inertia = 0.5 * (found.inertia + found.inertia.T)
    nearest = nearest_inertia(inertia, LEAST_MOMENT_RATIO)
    moved = np.abs(np.linalg.eigvalsh(nearest) - found.principal.moments)
    return nearest if np.all(moved <= NOISE * found.principal.moments_se) else inertia


def write_calibrated(
    calibration: Calibration, folder: Path, payload: int = 0, initial: tuple[Array, Array] | None = None
) -> None:
    """Write the calibrated team as an extended model, which ``mocobot simulate --model`` takes.

    Raises:
        InputError: as ``calibrated_team``, or the folder cannot be written.
    """
    scene = calibrated_team(calibration, payload, initial)
    label = calibration.payloads[payload].label
    tilts = [effect for effect in scene.effects if isinstance(effect, BaseTilt)]
    write_extended(scene, tilts, folder, {"calibrated": True, "payload": label})
