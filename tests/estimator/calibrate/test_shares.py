"""What each recording contributes, against where the noise of the result comes from."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from estimator.arm.unit import AT, COUNT
from estimator.calibrate.calibration import GRASPS, INERTIAL
from estimator.calibrate.findings import shares
from estimator.calibrate.least_squares import Fit, Layout, Quadratic, TrialFit


def test_shares_are_those_of_the_noise() -> None:
    """Least squares of plain rows: the result is M_k e_k summed over recordings, whose noise e_k is white."""
    rng = np.random.default_rng(5)
    layout = Layout(2, 2, 2)
    own = np.arange(layout.size)
    held = np.r_[AT["tilt"], COUNT + np.r_[AT["tilt"]]]
    free = np.setdiff1d(own, held)
    trials = [np.r_[layout.of_units, layout.of_payload(k), layout.of_trial(k)] for k in range(2)]
    trials.append(np.r_[layout.of_units])  # a free one
    rows = [rng.normal(size=(300 + 200 * k, len(index))) for k, index in enumerate(trials)]
    information = np.eye(layout.size)  # a weak prior
    for A, index in zip(rows, trials, strict=True):
        information[np.ix_(index, index)] += A.T @ A
    C = np.zeros((layout.size, layout.size))
    C[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
    parts = [
        Quadratic(index, A.T @ A, np.zeros(len(index)), 0.0, len(A))
        for A, index in zip(rows, trials, strict=True)
    ]
    carried = tuple(TrialFit(part, part, part) for part in parts[:2])
    fields: dict[str, Any] = dict.fromkeys(Fit.__dataclass_fields__)
    fields |= {"layout": layout, "covariance": C, "point": SimpleNamespace(trials=carried, alone=(parts[2],))}
    found = shares(cast(Any, Fit)(**fields))
    assert len(found) == 3
    M = [C[:, index] @ A.T for A, index in zip(rows, trials, strict=True)]
    variance = [np.sum(m**2, axis=1) for m in M]
    grasps, inertial = ([np.r_[of(k)] for k in range(2)] for of in (layout.of_payload, layout.of_inertia))
    kinds = {
        "rod_length": np.r_[AT["rod_length"], COUNT + np.r_[AT["rod_length"]]],
        GRASPS: np.concatenate([at[:-10] for at in grasps]),
        INERTIAL: np.concatenate(inertial),
    }
    for kind, at in kinds.items():
        for share, part in zip(found, variance, strict=True):
            np.testing.assert_allclose(share[kind], np.mean(part[at] / np.diag(C)[at]))
        assert 0.98 < sum(share[kind] for share in found) < 1.0  # the rest is the prior's
    assert "tilt" not in found[0]
    assert found[2][INERTIAL] < 0.1 < found[2]["rod_length"]
