"""Small random linear problems for the diagnosis, and the same solved by one plain least squares."""

from dataclasses import dataclass, replace

import numpy as np

from discrepancy.candidate import Candidate, Parameter
from discrepancy.rig import Rows


def candidate(name, *parameters, transient=None):
    """Parameters as (tolerance, scale)."""
    listed = tuple(Parameter(f"{name}{k}_x", t, s) for k, (t, s) in enumerate(parameters))
    return Candidate(name, name, 1, None, listed, {}, transient)


CANDIDATES = (
    candidate("one", (0.5, 9.0)),
    candidate("two", (0.1, 9.0), (2.0, 9.0)),
    candidate("event", (0.0, 0.3)),
    candidate("three", (0.4, 1.0), (0.3, 1.0), (0.2, 1.0)),
    candidate("events", (0.0, 0.3), (0.0, 5.0)),
)


def random_rows(
    rng, trials=3, n=40, channels=3, local=2, shared=2, candidates=CANDIDATES, moving=None, groups=None
):
    out = []
    for t in range(trials):
        out.append(
            Rows(
                f"trial {t}",
                rng.standard_normal((n, channels)),
                rng.standard_normal((n, channels, local)),
                rng.standard_normal((n, channels, shared)),
                [0.5 * rng.standard_normal((n, channels, len(c.parameters))) for c in candidates],
                np.arange(n) / 10.0,
                moving,
                groups,
            )
        )
    return out


def with_residuals(rows, residuals):
    return [replace(r, residual=x) for r, x in zip(rows, residuals, strict=True)]


@dataclass
class Solution:
    """shared and causes [units, by candidate], local by trial, misfit with and without the prior's part."""

    shared: np.ndarray
    causes: dict
    local: list
    misfit: float
    data_misfit: list


def cosines(n, moving=None):
    """The orthonormal cosine transform of the first ``moving`` of n rows, written out, shape (n, n)."""
    m = n if moving is None else moving
    k, i = np.mgrid[:m, :m]
    out = np.eye(n)
    out[:m, :m] = np.sqrt(2.0 / m) * np.cos(np.pi * k * (i + 0.5) / m)
    out[0, :m] = np.sqrt(1.0 / m)
    return out


def noise_covariance(row, power):
    """Covariance of a trial's rows, numbers in the order of ``ravel``, from variances in the transform (n, C)."""
    n, channels = row.residual.shape
    D = cosines(n, row.moving)
    K = np.zeros((n, channels, n, channels))
    for c in range(channels):
        K[:, c, :, c] = D.T @ (power[:, c, None] * D)
    return K.reshape(n * channels, n * channels)


def brute(rows, candidates, free=(), trials=None, background=True, fixed=None, noise=None, spread=None):
    """Augmented least squares with every trial's own unknowns as columns and every tolerance as a row.

    Args:
        noise: covariance of every trial's noise, (n C, n C); None for white noise.
        spread: of every column of the candidates over its unit; None for 1.
    """
    trials = range(len(rows)) if trials is None else trials
    used = []
    for index, c in enumerate(candidates):
        for k, p in enumerate(c.parameters):
            held = fixed is not None and fixed[0] == index
            if index in free or (background and p.tolerance > 0 and not held):
                used.append((index, k, p.tolerance or p.scale, index not in free))
    shared = rows[0].shared.shape[2]
    own = rows[0].local.shape[2]
    width = shared + len(used) + own * len(trials)
    blocks, right = [], []
    for place, t in enumerate(trials):
        r = rows[t]
        A = np.zeros((r.residual.size, width))
        A[:, :shared] = r.shared.reshape(-1, shared)
        for at, (index, k, unit, _) in enumerate(used):
            A[:, shared + at] = r.causes[index][..., k].ravel() * unit
        start = shared + len(used) + own * place
        A[:, start : start + own] = r.local.reshape(r.residual.size, own)
        b = r.residual.ravel().copy()
        if fixed is not None:
            index, values = fixed
            b -= (r.causes[index] @ (candidates[index].units * values)).ravel()
        if noise is not None:
            root = np.linalg.cholesky(noise[t])
            A, b = np.linalg.solve(root, A), np.linalg.solve(root, b)
        blocks.append(A)
        right.append(b)
    data, b = np.concatenate(blocks), np.concatenate(right)
    prior = np.eye(width)[[shared + at for at, entry in enumerate(used) if entry[3]]]
    if spread is not None:
        first = np.cumsum([0, *(len(c.parameters) for c in candidates)])
        prior /= np.array([spread[first[i] + k] for i, k, _, tight in used if tight])[:, None]
    x = np.linalg.lstsq(np.vstack([data, prior]), np.append(b, np.zeros(len(prior))), rcond=1e-12)[0]
    misfits = [float(np.sum((v - A @ x) ** 2)) for A, v in zip(blocks, right, strict=True)]
    causes = {}
    for at, (index, _, _, _) in enumerate(used):
        causes.setdefault(index, []).append(x[shared + at])
    local = [x[shared + len(used) + own * p :][:own] for p in range(len(trials))]
    return Solution(x[:shared], causes, local, sum(misfits) + float(np.sum((prior @ x) ** 2)), misfits)


def drawn_noise(rng, problem):
    """Another power in every cell, another spread of every column with a tolerance."""
    power = [rng.uniform(0.5, 4.0, len(p)) for p in problem.power]
    return problem.with_noise(
        power, np.where(problem.tolerant, rng.uniform(1.0, 5.0, problem.spread.shape), 1.0)
    )
