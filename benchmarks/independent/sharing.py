"""How the robots share the payload's wrench: six equations for three forces, the rest by what a team might want."""

from __future__ import annotations

import numpy as np

from independent.numerics import Array

STIFFNESS_N_PER_M = 120.0
"""Of the springs that robots seem to hold their wrists with; what it does beyond the balance is internal."""


def shared_forces(arm: Array, wanted: Array, force: Array, moment: Array) -> Array:
    """Forces on the payload that balance it and are as near to wanted ones as they can be.

    Args:
        arm: from the centre of mass to the wrists, W axes [m], shape (Q, N, 3).
        wanted: forces that a team might want, W axes [N], shape (Q, N, 3).
        force: that the forces have to sum to [N], shape (Q, 3).
        moment: that they have to give about the centre of mass [N m], shape (Q, 3).

    Returns:
        Forces on the payload in W [N], shape (Q, N, 3).
    """
    samples, robots = arm.shape[:2]
    G = np.zeros((samples, 6, robots, 3))
    G[:, :3] = np.eye(3)[None, :, None, :]
    x, y, z = arm[..., 0], arm[..., 1], arm[..., 2]
    for row, column, value in ((0, 1, -z), (0, 2, y), (1, 0, z), (1, 2, -x), (2, 0, -y), (2, 1, x)):
        G[:, 3 + row, :, column] = value
    G = G.reshape(samples, 6, 3 * robots)
    missing = np.concatenate([force, moment], axis=1) - (G @ wanted.reshape(samples, -1, 1))[..., 0]
    back = np.swapaxes(G, 1, 2)
    extra = back @ np.linalg.solve(G @ back, missing[..., None])
    return wanted + extra.reshape(samples, robots, 3)


def wanted_forces(rng: np.random.Generator, time: Array, weight: Array, shift: Array) -> Array:
    """Equal shares of the weight, slow squeezes of a few newtons, and springs that pull wrists home.

    Args:
        rng: source of the squeezes.
        time: fine grid [s], shape (Q,).
        weight: force that holds the payload [N], shape (3,).
        shift: of the wrists from home in W [m], shape (Q, N, 3).
    """
    robots = shift.shape[1]
    rate, phase = rng.uniform(0.03, 0.4, (4, robots, 3)), rng.uniform(0, 2 * np.pi, (4, robots, 3))
    size = rng.normal(0.0, 1.2, (4, robots, 3))
    waves = (size * np.sin(2 * np.pi * time[:, None, None, None] * rate + phase)).sum(axis=1)
    constant = rng.normal(0.0, 2.0, (robots, 3))
    return weight / robots + constant + waves - STIFFNESS_N_PER_M * shift
