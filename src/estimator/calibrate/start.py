"""Where a calibration starts: robots as designed, the payload as the staged estimate has it, bases from the joints."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.unit import ArmUnit
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.trial import corrected, level_data
from estimator.rigid_team.residual import Bases, Shared


def start_bases(rows: Rows, units: ArmUnit, shared: Shared) -> Bases:
    """Bases of one trial, in which all robots agree on average about where the payload is."""
    data = level_data(corrected(rows(rows.s), units), units)
    R, h = data.R_bi, data.h
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(1, h.shape[1]):
        mean = so3.chordal_mean(R[:, 0] @ shared.grasps.R_1i[i] @ np.swapaxes(R[:, i], -1, -2))
        yaw = np.arctan2(mean[1, 0] - mean[0, 1], mean[0, 0] + mean[1, 1])
        turns.append(Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix())
        places.append(np.mean(h[:, 0] + R[:, 0] @ shared.grasps.p_1i[i] - h[:, i] @ turns[i].T, axis=0))
    return Bases(np.array(turns), np.array(places))
