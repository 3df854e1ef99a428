"""What a fit says about further columns, group by group: the same as from dense covariances of all rows."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from discrepancy.laws.told import Beside
from discrepancy.least_squares.columns import Columns
from discrepancy.least_squares.fit import Fit
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from linear_problem import CANDIDATES, noise_covariance, random_rows

FREE, GROUPS = (2,), (1, 3, 2)


@pytest.mark.parametrize("size", [None, 3.0])
@pytest.mark.parametrize("single", [False, True])
def test_each_group_beside_the_model_as_by_dense_covariances(monkeypatch, size, single):
    """With and without what a cause leaves open; with columns held twice, or too many for that."""
    rng = np.random.default_rng(11)
    rows = random_rows(rng, n=20, moving=17, groups=[0, 0, 1])
    problem = Problem.of(rows, CANDIDATES)
    power = [rng.uniform(0.5, 2.0, len(cells.sizes)) for cells in problem.cells]
    problem = problem.with_noise(power, rng.uniform(0.5, 3.0, len(problem.spread)))
    opened = [rng.standard_normal((*r.residual.shape, 4)) for r in rows]
    if size is not None:
        problem = problem.with_unknowns(("open", 1, None), [Patches.of(u) for u in opened], size)
    further = [rng.standard_normal((*r.residual.shape, sum(GROUPS))) for r in rows]
    monkeypatch.setattr(Columns, "is_single", single)

    found = Beside(Fit.of(problem, FREE)).each(further, GROUPS)

    covariance = _without_unknowns(rows, problem, opened, size)
    wanted = np.concatenate([x.reshape(-1, sum(GROUPS)) for x in further])
    y = np.concatenate([r.residual.ravel() for r in rows])
    for (information, score), at in zip(found, np.split(np.arange(sum(GROUPS)), [1, 4]), strict=True):
        np.testing.assert_allclose(information, wanted[:, at].T @ covariance @ wanted[:, at], rtol=1e-7)
        np.testing.assert_allclose(score, wanted[:, at].T @ covariance @ y, rtol=1e-7, atol=1e-7)


def _without_unknowns(rows, problem, opened, size):
    """Inverse of all rows' covariance, tolerated causes in it; shared, own and free unknowns are flat, in turn.

    What causes leave open is whitened as if the noise had unit power, and by the cells' powers after that.
    """
    noise, flat = [], []
    for t, (r, u) in enumerate(zip(rows, opened, strict=True)):
        own, u = r.local.reshape(r.residual.size, -1), u.reshape(r.residual.size, -1)
        q = np.linalg.qr(own)[0]
        off = np.eye(len(q)) - q @ q.T
        white = off
        if size is not None:
            values, vectors = np.linalg.eigh(np.eye(len(q)) + size**2 * off @ u @ u.T @ off)
            white = (vectors / np.sqrt(values)) @ vectors.T @ off
        noise.append(
            white @ np.linalg.inv(noise_covariance(r, problem.power[t][problem.cells[t].index])) @ white
        )
        causes = [x * c.units for x, c in zip(r.causes, CANDIDATES, strict=True)]
        flat.append(np.concatenate([r.shared, *causes], axis=2).reshape(r.residual.size, -1))
    weight, columns = block_diag(*noise), np.concatenate(flat)
    shared, spread = problem.shared, problem.spread
    used = problem.tolerant.copy()
    prior = np.where(problem.tolerant, spread**-2.0, 0.0)
    for index in FREE:
        used[problem.columns_of(index)], prior[problem.columns_of(index)] = True, 0.0
    used, prior = np.append(np.ones(shared, dtype=bool), used), np.append(np.zeros(shared), prior)
    A = columns[:, used]
    inner = np.linalg.inv(A.T @ weight @ A + np.diag(prior[used]))
    return weight - weight @ A @ inner @ A.T @ weight
