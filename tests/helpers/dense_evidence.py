"""The evidence of a hypothesis from dense covariances: what ``learn`` says with Gram matrices and cells."""

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from discrepancy import rules
from linear_problem import noise_covariance


def dense_evidence(rows, problem, free, power=None, spread=None, noise=None):
    """Log density of all data, shared unknowns flat, noise and candidates normal, no own unknowns.

    Args:
        rows: of every trial.
        problem: for the candidates' places; its powers and spreads, unless given.
        free: candidates in the model in spite of being no tolerance.
        power, spread: of every cell of every trial, of every candidate column.
        noise: covariance of every trial's rows, in place of that of its powers.
    """
    power = problem.power if power is None else power
    spread = problem.spread if spread is None else spread
    if noise is None:
        noise = [noise_covariance(r, p[c.index]) for r, p, c in zip(rows, power, problem.cells, strict=True)]
    columns = np.concatenate(
        [
            x[..., :-1].reshape(-1, x.shape[2] - 1)
            for x in (problem.raw_columns(t, slice(None)) for t in problem.trials)
        ]
    )
    X, A = columns[:, : problem.shared], columns[:, problem.shared :]
    used = problem.tolerant.copy()
    for index in free:
        used[problem.columns_of(index)] = True
    y = np.concatenate([r.residual.ravel() for r in rows])
    K = block_diag(*noise) + (A[:, used] * spread[used] ** 2) @ A[:, used].T
    inverse_X = np.linalg.solve(K, X)
    H = X.T @ inverse_X
    best = np.linalg.solve(H, inverse_X.T @ y)
    return multivariate_normal.logpdf(y, X @ best, K) - 0.5 * np.linalg.slogdet(H)[1]


def log_prior(problem, kinds, power=None, spread=None):
    """Of powers and of the spreads of kinds (indices of their candidates), 0 at 1, as docs and rules state them."""
    power = problem.power if power is None else power
    spread = problem.spread if spread is None else spread
    cells = np.concatenate([p[c.sizes > 0] for p, c in zip(power, problem.cells, strict=True)])
    out = -0.5 * rules.POWER_NUMBERS * np.sum(np.log(cells) + 1.0 / cells - 1.0)
    for members in kinds:
        s = spread[problem.columns_of(members[0])][0]
        out -= 0.5 * rules.SPREAD_NUMBERS * (2.0 * np.log(s) + s**-2.0 - 1.0)
    return out
