"""From a recording's joint angles and spring torques to the data points D_iq (paper, section IV.B)."""

import numpy as np

from estimator.apart import apart
from estimator.arm.arms import Arms, levelled
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import differentiate, low_pass, trim_slice
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.model import Recording
from estimator.signals.arm_data import arm_data
from estimator.signals.grasp_data import GraspData

BLOCK = 16_384
"""Samples of one robot that are converted at a time; the result does not depend on it."""


def process_recording(recording: Recording, cutoff_hz: float = 5.0, trim_s: float = 2.0) -> GraspData:
    """Filter, differentiate and convert a recording to poses, twists, twist derivatives and wrenches.

    Readings are corrected where the metadata know the robots as they are. Joint angles and torques pass
    through the same zero-phase filter. Rates and accelerations come from sixth-order differences of the
    *joint* angles; the twist (29), its derivative and the wrench then follow analytically.

    Args:
        recording: one trial.
        cutoff_hz: cut-off of the Butterworth filter [Hz], at least 1/trim_s: transients die as
            exp(-pi cutoff t), and what a lower cut-off leaves of them after trim_s is no motion.
        trim_s: time dropped at each end against filter transients [s].

    Raises:
        InputError: the recording is not usable (see ``check_recording``), or an option is out of range.
    """
    check_recording(recording)
    check_duration(recording, trim_s)
    if cutoff_hz > 0.0 and 0.0 < cutoff_hz * trim_s < 1.0:
        raise InputError(
            f"cutoff_hz is {cutoff_hz!r}; with {trim_s:g} s dropped at each end it must be at least "
            f"{1.0 / trim_s:g} Hz, or the filter's transients remain"
        )
    rate_hz = recording.metadata.rate_hz
    keep = trim_slice(len(recording.time), rate_hz, trim_s)
    time = recording.time[keep]
    shape = len(time), recording.metadata.robots
    data = GraspData(
        time=time,
        R_bi=np.empty((*shape, 3, 3)),
        p_bi=np.empty((*shape, 3)),
        twist=np.empty((*shape, 6)),
        twist_dot=np.empty((*shape, 6)),
        wrench=np.empty((*shape, 6)),
        rate_hz=rate_hz,
        gravity_mps2=recording.metadata.design.gravity_mps2,
    )
    for robot in range(shape[1]):
        arm = recording.arm(robot)
        read = low_pass(np.concatenate(recording.joints(robot), axis=1), rate_hz, cutoff_hz)
        motion, tau = _derivatives(read[:, :6], rate_hz, keep), apart(read[keep, 6:], 1)
        # In blocks: what lies between takes ten times the memory of the result.
        for first in range(0, len(time), BLOCK):
            block = slice(first, first + BLOCK)
            _fill(data, robot, block, motion[:, block, :3], motion[:, block, 3:], tau[block], arm)
    return data


def _derivatives(angles: Array, rate_hz: float, keep: slice) -> Array:
    """Angles [rad], rates and accelerations of the samples to be kept, shape (3, q, 6)."""
    rate = differentiate(angles, rate_hz)
    return apart(np.stack([angles[keep], rate[keep], differentiate(rate, rate_hz)[keep]]), 1)


def _fill(
    data: GraspData,
    robot: int,
    block: slice,
    phi: Array,
    theta: Array,
    tau: Array,
    arm: Arms,
) -> None:
    """Data points of one robot from its angles with their derivatives, (3, q, 3), and its torques, (q, 3)."""
    found = arm_data((phi[0], phi[1], phi[2]), (theta[0], theta[1], theta[2]), tau, arm)
    data.R_bi[block, robot], data.p_bi[block, robot] = levelled(arm, found.R_bi, found.h)
    data.twist[block, robot], data.twist_dot[block, robot] = found.twist, found.twist_dot
    data.wrench[block, robot] = found.wrench
