"""Poses as plain JSON values, and back."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError
from estimator.strict import Fields

POSE = ("position_m", "quaternion_wxyz")


def poses_to_list(poses: RigidTransform) -> list[dict[str, list[float]]]:
    """One object per pose."""
    quats = poses.rotation.as_quat(scalar_first=True)
    return [
        dict(zip(POSE, (p.tolist(), q.tolist()), strict=True))
        for p, q in zip(poses.translation, quats, strict=True)
    ]


def read_poses(read: Fields, key: str, count: int) -> RigidTransform:
    """Poses as ``poses_to_list`` writes them.

    Raises:
        InputError: they are not so many, or one of them is no pose.
    """
    positions, quats = [], []
    for i, entry in enumerate(read.list(key, count), start=1):
        pose = Fields(entry, POSE, f"{read.where}: {key}[{i}]")
        positions.append(pose.array("position_m", (3,)))
        quats.append(pose.array("quaternion_wxyz", (4,)))
        if abs(np.linalg.norm(quats[-1]) - 1.0) > 1e-6:
            raise InputError(f"{pose.where}: quaternion_wxyz has not length 1; it must have")
    return RigidTransform.from_components(np.array(positions), Rotation.from_quat(quats, scalar_first=True))
