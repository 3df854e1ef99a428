"""A robot let go from a state, under given torques."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.arrays import Array
from mocobot_sim.serial.built import Built
from mocobot_sim.serial.extended import step

Drive = Callable[[float, Array, Array], Array]
"""Torques at the joints (J,) by time [s], positions and velocities (J,)."""
MOST_SPEED = 1e4
"""Beyond which a run is not followed [rad/s or m/s]: no joint is a hundredth as fast, and MuJoCo still has numbers."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where a rollout begins.

    Attributes:
        time: [s].
        q, dq, ddq: positions, velocities and accelerations, shape (J,) each; with the latter the integration is
            centred, and friction by load begins.
    """

    time: float
    q: Array
    dq: Array
    ddq: Array


def rollout(built: Built, start: Start, drive: Drive, samples: int, every: int) -> Array:
    """Positions after every so many steps, shape (n, J), the start's first; n < samples + 1 where a run breaks off.

    It breaks off where a number is not finite or a joint is faster than ``MOST_SPEED``.

    Args:
        built: the robot.
        start: its state.
        drive: what its drives give.
        samples: how many to take after the start.
        every: steps of the integration between samples.
    """
    model = built.model
    data, effects = mujoco.MjData(model), built.running()
    data.time, data.qpos[:], data.qacc[:] = start.time, start.q, start.ddq
    # MuJoCo's positions go on with the velocity after a step: from half a step before, errors are of second order.
    data.qvel[:] = start.dq - 0.5 * model.opt.timestep * start.ddq
    out = np.empty((samples + 1, model.nq))
    out[0] = start.q
    for k in range(1, samples + 1):
        for _ in range(every):
            step(model, data, effects, drive(data.time, data.qpos, data.qvel))
            if not np.abs(data.qvel).max() < MOST_SPEED:  # nor where it is no number
                return out[:k]
        out[k] = data.qpos
    return out
