"""Logs held against a reference: what serves twice tells once, and doubts are those without one."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.paired import PairedRig
from serial_made import nominal, simulated, spec


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return nominal(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def log():
    return simulated(spec().compile(), 0)


@pytest.fixture(scope="module")
def paired(model, log):
    """Nine blocks of a changed robot, two of the reference."""
    whole = simulated(spec().compile(), 1)
    early = whole.time < whole.time[0] + 6.0
    short = replace(
        whole,
        time=whole.time[early],
        q=whole.q[early],
        torque=whole.torque[early],
        usable=whole.usable[early],
    )
    rig = LawfulSerialRig.of(model, [log], reference=[short])
    assert 0 < len(rig.trials) - rig.changed < rig.changed
    return PairedRig(rig)


def test_a_block_of_the_reference_that_serves_twice_tells_once(paired):
    """Each trial had it in full: errors were smaller by as much as it was repeated."""
    inner, candidates = paired.inner, paired.candidates()
    kinds = [c for c in candidates if c.cause == "friction"]
    of_blocks = [sum(np.sum(x[k] ** 2) for x in map(inner.columns, kinds)) for k in range(len(inner.trials))]
    of_trials = [
        sum(np.sum(x[t] ** 2) for x in map(paired.columns, kinds)) for t in range(len(paired.trials))
    ]
    assert sum(of_trials) == pytest.approx(sum(of_blocks), rel=1e-9)
    together = list(paired.rows(candidates))
    alone = list(inner.rows(candidates))
    for part in ("residual", "local", "shared"):
        whole = sum(float(np.sum(getattr(row, part) ** 2)) for row in together)
        assert whole == pytest.approx(sum(float(np.sum(getattr(row, part) ** 2)) for row in alone), rel=1e-9)
    left = paired.residual(np.zeros(together[0].shared.shape[2]), [], [])
    np.testing.assert_allclose(left[0], together[0].residual, rtol=1e-9, atol=1e-12)


def test_held_against_a_reference_laws_are_in_doubt_as_they_are_without(paired):
    """They had been those of a team, whose laws are known better."""
    friction, ripple = (
        next(c for c in paired.candidates() if c.cause == kind) for kind in ("friction", "ripple")
    )
    assert paired.law_doubt(friction) == paired.inner.law_doubt(friction)
    there = [(friction, np.array([0.5, 0.1]))]
    same = next(c for c in paired.candidates() if c.cause == "ripple" and c.joint == friction.joint)
    forms = paired.other_forms(same, np.ones(len(same.parameters)), there)
    assert [len(f) for f in forms] == [len(c) for c in paired.columns(same)]
    assert ripple.joint == 1
