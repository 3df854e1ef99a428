"""Simulate recorded commands with the estimated team, and measure the deviation from the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from discrepancy.candidate import Candidate
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.signals import Signals
from estimator.arm.unit import ArmUnit, true_joints
from estimator.arrays import Array, inertia_matrix
from estimator.errors import InputError
from estimator.estimate.inertia import about_com
from estimator.quantisation import without_held
from estimator.recording.model import Recording
from estimator.rigid_team import Bases, Shared
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.catalogue import apply_effects, make_effect
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.as_built import units_as_built
from mocobot_sim.scene.models import base_height_m, omnid_design
from mocobot_sim.scene.payload import nearest_inertia, payload_mjcf
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.resimulate import predicted, resimulate

MARGIN_SHARE = 0.02
"""Relative difference of chi-square below which simulations are equally good. Chosen."""


@dataclass(frozen=True)
class Response:
    """Deviation of one trial's recorded response from the simulated one.

    Attributes:
        rms: by channel, in the channel's unit.
        nrmse: by channel, over the standard deviation of the motion.
        chi2_per_n: mean square over the variance of sensor noise and integration error.
    """

    rms: Mapping[str, float]
    nrmse: Mapping[str, float]
    chi2_per_n: float

    @classmethod
    def of(cls, errors: Mapping[str, Array], scales: Mapping[str, tuple[Array, Array]]) -> Response:
        """Compute the deviation.

        Args:
            errors: recorded minus simulated, by channel, shape (Q, N, 3).
            scales: standard deviations of noise and of motion, by channel, shape (N, 3) each.
        """
        rms, nrmse, squares = {}, {}, []
        for name, error in errors.items():
            noise, motion = scales[name]
            rms[name] = float(np.sqrt(np.mean(error**2)))
            nrmse[name] = rms[name] / float(np.sqrt(np.mean(motion**2)))
            squares.append(np.mean((error / noise) ** 2))
        return cls(rms, nrmse, float(np.mean(squares)))


@dataclass(frozen=True)
class Gain:
    """Responses of every trial that can be simulated, without and with the causes, fitted to the other trials.

    Attributes:
        before, after: one per trial; None if the simulation failed.
        held_out: whether trials are predicted from others. False for a single trial, or if a cause acts in some trials
            only, because all trials then estimate it.
        as_found: responses with the causes and with all deviations of healthy parts; empty if not requested.
    """

    before: tuple[Response | None, ...]
    after: tuple[Response | None, ...]
    held_out: bool
    as_found: tuple[Response | None, ...] = ()

    @property
    def pairs(self) -> list[tuple[Response, Response]]:
        """Trials that were simulated both ways."""
        both = zip(self.before, self.after, strict=True)
        return [(a, b) for a, b in both if a is not None and b is not None]

    @property
    def is_better_as_found(self) -> bool:
        """Whether the deviations of healthy parts improve the response of all trials further."""
        return bool(self.as_found) and mean_chi2(self.as_found) < mean_chi2([b for _, b in self.pairs])


def is_worse(chi2_per_n: float, than: float) -> bool:
    """Whether a mean chi-square is worse than another; values up to 1 are within the noise and equally good."""
    return chi2_per_n > max(than, 1.0) * (1.0 + MARGIN_SHARE)


def mean_chi2(trials: Sequence[Response | None]) -> float:
    """Mean chi-square per number; infinite if a trial could not be simulated."""
    return float(np.mean([np.inf if r is None else r.chi2_per_n for r in trials]))


LEAST_MOMENT_RATIO = 1e-3
"""Least principal moment of a simulated payload over the largest. Chosen: a body needs some inertia."""

TEAM_TIMESTEP_S = 1e-3
"""Step of the closed-loop simulation [s]. Chosen: the integration error stays below the sensor noise."""

PHI_FLOOR_RAD, THETA_FLOOR_RAD, TAU_FLOOR_NM = 2.5e-5, 1e-5, 6e-4
"""Integration errors of the closed loop. Measured: steps of 1 ms against 0.25 ms."""


def team_of(
    shared: Shared,
    bases: Bases,
    effects: Sequence[Effect],
    initial: tuple[Array, Array] | None = None,
    units: ArmUnit | None = None,
) -> TeamScene:
    """Build the team that the unknowns describe, with effects applied.

    Args:
        shared: grasps and inertial parameters.
        bases: poses of the bases in {b1}.
        effects: deviations from the model.
        initial: true posture near which trials start, (phi, theta), (N, 3) each.
        units: the robots as they are; None for robots as designed.
    """
    grasps = shared.grasps
    # The estimated payload and base positions include contributions of the effects: subtract them.
    pi = shared.pi - sum((effect.carried() for effect in effects), np.zeros(10))
    shift = np.zeros_like(bases.p)
    for effect in effects:
        shift[getattr(effect, "robot", 1) - 1] += effect.base_shift()
    p = bases.p - np.einsum("nij,nj->ni", bases.R, shift)
    about_c = about_com(pi)
    X_1i = RigidTransform.from_components(grasps.p_1i, Rotation.from_matrix(grasps.R_1i))
    payload = payload_mjcf(float(pi[0]), about_c[1:4], physical_inertia(inertia_matrix(about_c[4:])), X_1i)
    as_built, R = (), bases.R
    if units is not None:
        as_built, R = units_as_built(units), bases.R @ units.R_ba
        # A base tilts about {b}, and stands on its mount below.
        down = np.array([0.0, 0.0, base_height_m()])
        p = p + down - R @ down
    mounts = RigidTransform.from_components(p, Rotation.from_matrix(R))
    scene = build_team(payload, as_built, mounts=mounts, initial=initial, timestep_s=TEAM_TIMESTEP_S)
    return apply_effects(scene, effects)


def effect_of(candidate: Candidate, values: Array, context: Context) -> Effect | None:
    """The simulator's effect, or None if it cannot have such values (a negative play)."""
    cause = CAUSES[candidate.cause]
    parameters = cause.physical(values, context)
    for name in cause.clipped:
        parameters[name] = max(parameters[name], 0.0)
    try:
        return make_effect(candidate.cause, parameters, candidate.robot, candidate.joint)
    except InputError:
        return None


def named_effects(candidate: Candidate, effects: Sequence[Effect] | None) -> Sequence[Effect]:
    """Return the effects of a named cause.

    Raises:
        InputError: there are none.
    """
    if effects is None:
        raise InputError(f"{candidate.label}: no effect has the values found; nothing to extend")
    return effects


def why_not(recording: Recording) -> str | None:
    """Reason why a recording cannot be simulated again, or None."""
    if recording.base is not None:
        return f"{recording.name} is of driving bases, whose contacts are not simulated again"
    if recording.ref is None:
        return f"{recording.name} has no commands (ref_x, ref_y, ref_z)"
    if not recording.metadata.control or "feed_forward_N" not in recording.metadata.control:
        return f"{recording.name} has no control gains and feed-forward in its metadata"
    if recording.metadata.design != omnid_design():
        return f"{recording.name} is of another design than the simulated Omnid"
    return None


def posture(recording: Recording) -> tuple[tuple[Array, Array], ArmUnit | None]:
    """True (phi, theta) of the first sample, (N, 3) each, and the calibration of the robots if it is known."""
    units = recording.metadata.units
    phi, theta, _ = true_joints(
        recording.metadata.arms, recording.phi[0], recording.theta[0], recording.tau[0]
    )
    return (phi, theta), units


def scale_of_response(noise: Noise, signals: Signals) -> dict[str, tuple[Array, Array]]:
    """Standard deviation of the noise and of the motion, by channel, shape (N, 3) each."""
    floors = {"phi": PHI_FLOOR_RAD, "theta": THETA_FLOOR_RAD, "tau": TAU_FLOOR_NM}
    out = {}
    for k, (name, floor) in enumerate(floors.items()):
        sigma = np.sqrt(noise.sigma[k] ** 2 + noise.step[k] ** 2 / 12.0 + floor**2)
        out[name] = sigma, np.std(getattr(signals, name)[signals.keep], axis=0)
    return out


def impossible() -> None:
    """Stand in for a simulation with an impossible effect."""
    return None


def physical_inertia(inertia: Array) -> Array:
    """The nearest inertia that a rigid body can have: principal moments positive, none above the others' sum."""
    return nearest_inertia(inertia, LEAST_MOMENT_RATIO)


def resimulation_errors(
    recording: Recording, shared: Shared, bases: Bases, effects: Sequence[Effect], number: int, keep: slice
) -> dict[str, Array] | None:
    """Recorded minus simulated phi, theta [rad] and tau [N m] of one trial, shape (Q, N, 3) each.

    Returns None if the simulation cannot be built or fails.
    """
    try:
        scene = team_of(shared, bases, effects, *posture(recording))
        log = resimulate(recording, replace(scene), timestep_s=TEAM_TIMESTEP_S, trial_number=number)
    except (TrialError, InputError):
        return None
    simulated, (recording, *_) = predicted(log), without_held(recording)
    return {
        name: (getattr(recording, name) - getattr(simulated, name))[keep] for name in ("phi", "theta", "tau")
    }
