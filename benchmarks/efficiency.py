"""How near the Cramer-Rao bound the estimates of one team are, over draws of the sensors' noise.

    python benchmarks/efficiency.py --payload c --draws 12
    python benchmarks/efficiency.py --robots uncalibrated --sensors rounded

One set of trials is simulated and read again and again. The bound is that of the raw samples at the full rate: at
every instant loops and balance hold for the true angles and torques, and what is read is these plus white noise, so the
samples' information about grasps, payload and bases (and robots, with their prior, where these are calibrated) is

    sum over samples of D^T (B Q B^T)^-1 D,

D and B the derivatives of loops and balance by the unknowns and by the readings, on the noise-free trajectory. The
payload's pose at every instant is free in this, which costs the loops nothing; its rates and accelerations are taken to
be known, so that no unbiased estimate can be better than this bound, and one that has to differentiate may be a little
worse (at 1 Hz the encoders' noise is a tenth of the springs' in the balance). Nothing is lost to a filter. With
``rounded`` sensors the bound is that of white noise of the same variance, which rounding at rest is not.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import tyro
from scipy.sparse import csr_array
from tqdm import tqdm

from calibration import HELD, Found, Truth, centred, found_of, grasp_errors, of_estimate
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.equations import TrialEquations, corrected
from estimator.calibrate.least_squares import Layout, Quadratic
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows, Sensing
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.payload import estimate_payload
from estimator.filtering import differentiate, low_pass
from estimator.recording.model import Recording
from estimator.rigid_team import Shared, robot_data, start_bases
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_sim.trial.trial_log import TrialLog

STRIDE = 5
"""Every so-and-so-many-th sample stands for its neighbours in the bound: derivatives vary slowly."""
TRIM = 200
"""Samples at both ends that no estimate uses."""
GROUPS = {"m": slice(0, 1), "CoM": slice(1, 4), "I": slice(4, 10)}


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        payload: what the team carries.
        robots: preset that they are drawn from.
        seed: of robots and motion.
        draws: of the sensors' noise.
        sensors: "gaussian", or "rounded" as the preset has them.
    """

    payload: str = "c"
    robots: Literal["nominal", "uncalibrated"] = "nominal"
    seed: int = 300
    draws: int = 12
    sensors: Literal["gaussian", "rounded"] = "gaussian"


def main(options: Options) -> None:
    """Simulate once, read often, print the table."""
    preset = PRESETS[options.robots]
    assert preset.encoder_bits is not None
    step = 2.0 * np.pi / 2**preset.encoder_bits
    sigma = np.repeat([step, step, preset.tau_step_Nm], 3) / np.sqrt(12.0)
    sigma[6:] = np.hypot(sigma[6:], preset.tau_noise_Nm)
    done = [
        simulate(TrialRequest(options.payload, trial, options.seed), [preset])
        for trial in ("random", "periodic", "static")
    ]
    truth = Truth.of(done[0].truth.to_dict())
    held = 0.0 if preset.calibrated else truth.scale
    rng = np.random.default_rng([options.seed, options.draws])
    quiet = [_read(one.log, options, rng, None) for one in done]
    prior = HELD if preset.calibrated else Prior()
    bound = _bound(quiet, truth, sigma, prior)
    methods = (
        ("staged", "joint", "held", "calibrated") if preset.calibrated else ("staged", "joint", "calibrated")
    )
    squares: dict[str, list[Array]] = {method: [] for method in methods}
    cpu: dict[str, float] = dict.fromkeys(methods, 0.0)
    for _ in tqdm(range(options.draws), unit="draw", dynamic_ncols=True):
        recordings = [_read(one.log, options, rng, sigma) for one in done]
        for method in methods:
            start = time.process_time()
            found = _found(method, recordings)
            cpu[method] += time.process_time() - start
            squares[method].append(_squares(found, truth, held))
    print(
        f"payload ({options.payload}), {options.robots} robots, {options.sensors} sensors, {options.draws} draws"
    )
    print(
        "\n| rms error over bound | R | p | m | CoM | I | CPU [s] |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for method in methods:
        ratios = np.sqrt(np.mean(squares[method], axis=0) / bound)
        print(f"| {method} | {' | '.join(f'{x:.2f}' for x in ratios)} | {cpu[method] / options.draws:.1f} |")
    units = [f"{x:.3g}" for x in np.sqrt(bound) * [np.rad2deg(1.0), 1e3, 1e3, 1e3, 1e3]]
    print(f"| the bound itself [deg, mm, g, mm, g m^2] | {' | '.join(units)} | |")


def _read(log: TrialLog, options: Options, rng: np.random.Generator, sigma: Array | None) -> Recording:
    """One reading of a trial; without noise where ``sigma`` is None."""
    if sigma is not None and options.sensors == "rounded":
        return measure(log, PRESETS[options.robots], rng, payload=options.payload, name=log.trial)
    exact = measure(log, PRESETS["ideal"], rng, payload=options.payload, name=log.trial)
    if sigma is None:
        return exact
    shape = exact.phi.shape
    return replace(
        exact,
        phi=exact.phi + sigma[:3] * rng.standard_normal(shape),
        theta=exact.theta + sigma[3:6] * rng.standard_normal(shape),
        tau=exact.tau + sigma[6:] * rng.standard_normal(shape),
    )


def _found(method: str, recordings: Sequence[Recording]) -> Found:
    if method in ("staged", "joint"):
        found = of_estimate(estimate_payload(recordings, method, withhold=False))
        assert found is not None
        return found
    payload = calibrate(recordings, prior=HELD if method == "held" else None).payloads[0]
    return found_of(payload, payload.covariance)


def _squares(found: Found, truth: Truth, scale: float) -> Array:
    """Squared errors of rotations, positions, mass, centre of mass and inertia."""
    turned, shifted = grasp_errors(found.grasps, truth)
    true = centred(truth.parameters)
    true[[0, *range(4, 10)]] /= 1.0 + scale
    error = found.centred - true
    return np.array(
        [np.sum(turned**2), np.sum(shifted**2), *(np.sum(error[at] ** 2) for at in GROUPS.values())]
    )


def _bound(quiet: Sequence[Recording], truth: Truth, sigma: Array, prior: Prior) -> Array:
    """Traces of the least covariance of the same five, the mean spring ratio held."""
    N, nothing = len(truth.p_1i), np.zeros((len(truth.p_1i),) * 2)
    six = 6 * (N - 1)
    grasps = GraspEstimate(
        truth.R_1i, truth.p_1i, np.zeros((six, six)), nothing, nothing, np.zeros(N), np.zeros(N)
    )
    shared, units = Shared(grasps, truth.parameters), ArmUnit(quiet[0].metadata.design, truth.units)
    layout = Layout(N, 1, len(quiet))
    H = np.zeros((layout.size, layout.size))
    for k, recording in enumerate(quiet):
        samples = Rows.of(recording)
        data = robot_data(corrected(samples(samples.s), units), units)
        bases = start_bases(data.R_bi, data.h, shared)
        index = np.r_[layout.of_units, layout.of_payload(0), layout.of_trial(k)]
        for rows in _instants(recording, 500):
            still = np.zeros((N, 9))
            rowed = TrialEquations.of(rows, Sensing(still, np.tile(sigma, (N, 1)))).at(units, shared, bases)
            n, C = rowed.residual.shape
            D = np.concatenate([rowed.by_units.reshape(n, C, -1), rowed.by_carried, rowed.by_bases], axis=2)
            part = Quadratic.of(D, rowed.residual, rowed.covariance, index)
            H[np.ix_(part.index, part.index)] += STRIDE * part.H
    factor = prior.factor(N, hold_scale=True)
    basis = np.zeros((layout.size, factor.shape[1] + layout.size - len(factor)))
    basis[: len(factor), : factor.shape[1]] = factor
    basis[len(factor) :, factor.shape[1] :] = np.eye(layout.size - len(factor))
    information = basis.T @ H @ basis
    information[np.arange(factor.shape[1]), np.arange(factor.shape[1])] += 1.0
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = scale[:, None] * np.linalg.inv(information * np.outer(scale, scale)) * scale
    at = layout.of_payload(0)
    covariance = (basis @ inverse @ basis.T)[at, at]
    turns = np.diag(covariance)[:six].reshape(-1, 2, 3)
    payload = Found(
        grasps, centred(truth.parameters), _centred_covariance(truth.parameters, covariance[six:, six:])
    )
    parts = [np.trace(payload.covariance[one, one]) for one in GROUPS.values()]
    return np.array([turns[:, 0].sum(), turns[:, 1].sum(), *parts])


def _centred_covariance(parameters: Array, covariance: Array) -> Array:
    steps = 1e-6 * np.maximum(np.abs(parameters), 1e-2)
    J = np.column_stack([
        (centred(parameters + dx) - centred(parameters - dx)) / (2.0 * step)
        for dx, step in zip(np.diag(steps), steps, strict=True)
    ])  # fmt: skip
    return J @ covariance @ J.T


def _instants(recording: Recording, most: int) -> list[Rows]:
    """Single noise-free samples in place of rows; rates and accelerations without noise."""
    whole = _full_rate(recording)
    chosen = np.arange(TRIM, len(whole) - TRIM, STRIDE)
    gain = np.zeros((3, 3))
    gain[0, 0] = 1.0
    out: list[Rows] = []
    for part in np.array_split(chosen, -(-len(chosen) // most)):
        n, N = len(part), whole.shape[1]
        some: Any = np.full((n, N, 6), np.inf)
        out.append(
            Rows(
                whole[part],
                csr_array(np.eye(n)),
                recording.time[part],
                n,
                gain,
                np.zeros(n, dtype=np.intp),
                some,
                recording.metadata.rate_hz,
                1.0,
            )
        )
    return out


def _full_rate(recording: Recording) -> Array:
    """Readings with rates and accelerations at every sample, shape (Q, N, 21), as ``Rows`` has them before thinning."""
    rate = recording.metadata.rate_hz
    parts = []
    for x in (recording.phi, recording.theta):
        value = low_pass(x, rate, rules.PRE_HZ)
        speed = differentiate(value, rate)
        parts += [value, speed, differentiate(speed, rate)]
    return np.concatenate([*parts, low_pass(recording.tau, rate, rules.PRE_HZ)], axis=2)


if __name__ == "__main__":
    main(tyro.cli(Options))
