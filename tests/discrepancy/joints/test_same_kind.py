"""Two machines of one kind in a calibration: equal ones seldom differ, unlike ones are told, names are checked."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from discrepancy.joints.fit import Parameter
from discrepancy.joints.same_kind import compared, machines
from estimator.errors import InputError

NAMES, JOINTS = ("armature_kgm2", "coulomb_Nm", "offset_Nm"), ("L_hip", "L_knee", "R_hip", "R_knee")
ROOT = np.random.default_rng(0).normal(size=(12, 12)) * 1e-3
COVARIANCE = ROOT @ ROOT.T


def drawn(rng: np.random.Generator, off: float = 0.0) -> list[Parameter]:
    """Estimates with the covariance; the right knee's friction is larger by ``off``."""
    x = 0.3 + ROOT @ rng.normal(size=12)
    keys = [(joint, name) for joint in JOINTS for name in NAMES]
    x[keys.index(("R_knee", "coulomb_Nm"))] += off
    se = np.sqrt(np.diag(COVARIANCE))
    return [
        Parameter(place, name, 0.0, float(v), float(s), 1.0, determined=True)
        for (place, name), v, s in zip(keys, x, se, strict=True)
    ]


def test_equal_machines_seldom_differ():
    rng = np.random.default_rng(1)
    found = [compared(drawn(rng), COVARIANCE, ("L", "R")) for _ in range(2000)]
    assert {d.name for d in found[0].differences} == {
        "armature_kgm2",
        "coulomb_Nm",
    }  # mirror images share no offset
    for wrong in (sum(bool(one.unlike) for one in found), sum(one.probability < 0.01 for one in found)):
        assert binomtest(wrong, 2000, 0.01, alternative="greater").pvalue > 1e-3
    assert np.mean([one.probability for one in found]) == pytest.approx(0.5, abs=0.03)


def test_an_unlike_joint_is_told():
    one = compared(drawn(np.random.default_rng(2), off=0.05), COVARIANCE, ("L", "R"))
    assert [(d.places, d.name) for d in one.unlike] == [(("L_knee", "R_knee"), "coulomb_Nm")]
    assert one.unlike[0].values[1] - one.unlike[0].values[0] == pytest.approx(
        0.05, abs=6.0 * one.unlike[0].se
    )
    assert (
        one.sentence
        == "L and R differ by more than their errors in 1 of 4 quantities: Coulomb friction of L_knee."
    )
    assert "agree" not in "\n".join(one.lines())


def test_what_is_not_determined_is_not_compared():
    own = [
        Parameter(p.place, p.name, 0.0, p.value, p.se, 1.0, determined=False)
        for p in drawn(np.random.default_rng(3))
    ]
    assert [*compared(own, COVARIANCE, ("L", "R")).lines()] == [
        "The logs determine no quantity of both L and R, so they cannot be compared."
    ]


@pytest.mark.parametrize("same", ["", "L", "L=", "=R", "L=L"])
def test_other_forms_are_refused(same):
    with pytest.raises(InputError, match="must be LEFT=RIGHT, such as FL=FR"):
        machines(JOINTS, same)


def test_names_that_no_joints_have_are_refused():
    with pytest.raises(
        InputError, match=r"no joint with 'FL' in its name has one with 'FR' instead; .*L_hip, L_knee"
    ):
        machines(JOINTS, "FL=FR")
    assert machines(JOINTS, "L=R") == ("L", "R")
