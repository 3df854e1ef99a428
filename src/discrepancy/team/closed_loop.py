"""Run the recorded commands again, with the estimated payload and bases, with or without causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from discrepancy.team.linear.residual import Bases, Shared
from estimator.errors import InputError
from estimator.estimate.principal import inertia_matrix, inertia_parameters
from estimator.recording.model import Recording
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.base_tilt import BaseTilt
from mocobot_sim.effects.catalogue import apply_effects
from mocobot_sim.effects.slosh import Slosh
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.models import base_height_m
from mocobot_sim.scene.payload_mjcf import payload_mjcf
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.resimulate import predicted, rerun

Array = NDArray[np.float64]

TIMESTEP_S = 1e-3
SMALLEST = 1e-3
"""Least principal moment of a simulated payload over the largest: a body needs some."""


def team_of(
    shared: Shared, bases: Bases, effects: Sequence[Effect], initial: tuple[Array, Array] | None = None
) -> TeamScene:
    """The team that the unknowns describe, effects applied.

    Args:
        shared: grasps and inertial parameters.
        bases: where the robots stand, in {b1}.
        effects: what is off.
        initial: posture near which trials start, (phi, theta), (N, 3) each.
    """
    grasps, pi = shared.grasps, _without_swinging(shared.pi, effects)
    mass, p_1c = float(pi[0]), pi[1:4] / pi[0]
    about_c = inertia_matrix(pi[4:]) - mass * (p_1c @ p_1c * np.eye(3) - np.outer(p_1c, p_1c))
    X_1i = RigidTransform.from_components(grasps.p_1i, Rotation.from_matrix(grasps.R_1i))
    payload = payload_mjcf(mass, p_1c, physical_inertia(about_c), X_1i)
    mounts = RigidTransform.from_components(_mounts(bases, effects), Rotation.from_matrix(bases.R))
    scene = build_team(payload, mounts=mounts, initial=initial, timestep_s=TIMESTEP_S)
    return apply_effects(scene, effects)


def _without_swinging(pi: Array, effects: Sequence[Effect]) -> Array:
    """Inertial parameters of the payload alone, shape (10,): the rows have a swinging mass in them, at its pivot."""
    for effect in effects:
        if isinstance(effect, Slosh):
            at = np.array([effect.point_x_m, effect.point_y_m, effect.point_z_m])
            about_1 = inertia_parameters(at @ at * np.eye(3) - np.outer(at, at))
            pi = pi - effect.mass_kg * np.concatenate([[1.0], at, about_1])
    return pi


def _mounts(bases: Bases, effects: Sequence[Effect]) -> Array:
    """Where the robots stand on the floor, shape (N, 3), so that tilts leave the origins of {b} where they are.

    With a tilt in the model the bases are known in {b1} as it would be level: what robot 1's tilt does to all others
    is in its column. The simulated tilt turns a base about its mount.
    """
    tilt = np.zeros((len(bases.p), 3))
    for effect in effects:
        if isinstance(effect, BaseTilt):
            tilt[effect.robot - 1, :2] += effect.roll_rad, effect.pitch_rad
    height = np.array([0.0, 0.0, base_height_m()])
    swing = Rotation.from_rotvec(tilt).apply(np.tile(height, (len(tilt), 1))) - height
    return bases.p - np.einsum("nij,nj->ni", bases.R, swing)


def physical_inertia(inertia: Array) -> Array:
    """The nearest inertia that a rigid body can have: principal moments positive, none above the others' sum."""
    moments, axes = np.linalg.eigh(inertia)
    moments = np.maximum(moments, SMALLEST * max(moments[-1], 1e-9))
    excess = moments[2] - moments[0] - moments[1]
    if excess > 0:  # moved to the sum of the others in equal parts
        moments = moments + np.array([1.0, 1.0, -1.0]) * excess / 3.0 * 1.001
    return (axes * moments) @ axes.T


def errors_of_rerun(
    recording: Recording, shared: Shared, bases: Bases, effects: Sequence[Effect], number: int, keep: slice
) -> dict[str, Array] | None:
    """Recorded minus simulated phi, theta [rad] and tau [N m] of one trial, shape (Q, N, 3) each.

    None where the simulation of these effects cannot be trusted or assembled.
    """
    try:
        scene = team_of(shared, bases, effects, (recording.phi[0], recording.theta[0]))
        log = rerun(recording, replace(scene), timestep_s=TIMESTEP_S, trial_number=number)
    except (TrialError, InputError):
        return None
    simulated = predicted(log)
    return {
        name: (getattr(recording, name) - getattr(simulated, name))[keep] for name in ("phi", "theta", "tau")
    }
