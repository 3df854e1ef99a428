"""Time series of a replay: what was measured, what follows from it, and what a rigid payload leaves unexplained."""

from dataclasses import dataclass, replace

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.fusion import fuse
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.signals.grasp_data import GraspData
from estimator.signals.process import process_recording

CUTOFF_HZ, FILTERED_HZ = 5.0, 50.0
"""Cut-off of the filter, and the rate at which its output is kept."""


@dataclass(frozen=True)
class Balance:
    """What the robots' wrenches leave of Newton and Euler, in {1}.

    Attributes:
        force: sum of the forces minus m (a_c + g) [N], shape (P, 3).
        moment: sum of the moments about the centre of mass minus I alpha + omega x I omega [N m], shape (P, 3), or
            None without an inertia.
    """

    force: Array
    moment: Array | None


def filtered(recording: Recording, notes: list[str]) -> GraspData | None:
    """Twists and wrenches as the estimator sees them, times from the recording's first sample on.

    Thinned to ``FILTERED_HZ``: the filter leaves 1e-4 of what that cannot carry.

    Returns:
        The data points, or None (and why, in ``notes``) if the recording is too short.
    """
    try:
        data = process_recording(recording, CUTOFF_HZ)
    except InputError as error:
        notes.append(f"No twists and no wrenches: {error}.")
        return None
    step = max(1, int(data.rate_hz / FILTERED_HZ))
    arrays = {name: getattr(data, name)[::step] for name in ("R_bi", "p_bi", "twist", "twist_dot", "wrench")}
    return replace(data, time=data.time[::step] - recording.time[0], rate_hz=data.rate_hz / step, **arrays)


def balance(data: GraspData, estimate: PayloadEstimate) -> Balance | None:
    """Residual of the payload's motion, or None where grasps, mass or centre of mass are not known."""
    grasps, mass, p_1c = estimate.grasps, estimate.mass, estimate.p_1c
    if grasps is None or mass is None or p_1c is None:
        return None
    motion = fuse(data, grasps)
    lever = np.cross(motion.alpha, p_1c) + np.cross(motion.omega, np.cross(motion.omega, p_1c))
    weight = data.gravity_mps2 * motion.up
    force = motion.force - mass.mass * (motion.acceleration + lever + weight)
    if estimate.inertia is None:
        return Balance(force, None)
    inertia = estimate.inertia.inertia
    spin = motion.omega @ inertia
    euler = motion.alpha @ inertia + np.cross(motion.omega, spin)
    return Balance(force, motion.moment - np.cross(p_1c, motion.force) - euler)
