"""A transient against one sensor that is wrong for as long."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.candidate import Transient
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import search
from discrepancy.team.causes import CAUSES
from discrepancy.team.imitators import wrong_torques
from fake_rig import FakeRig
from team_case import exact, residual_of

TRIAL = 1


class Imitated(FakeRig):
    """One sensor is wrong in the direction of the push's first column, if ``turn`` is 0."""

    turn = 0.0

    def imitators(self, candidate):
        columns = self.columns(candidate)
        away = np.random.default_rng(5).standard_normal(columns[TRIAL][40:90, :, :1].shape)
        other = [np.zeros((*c.shape[:2], 1)) for c in columns]
        other[TRIAL][40:90] = np.cos(self.turn) * columns[TRIAL][40:90, :, :1] + np.sin(self.turn) * away
        return [other]


def with_burst(rig, values):
    candidate = rig.transients([])[0]
    x, local, shared = rig.data[TRIAL]
    rig.data[TRIAL] = x + rig.columns(candidate)[TRIAL] @ np.array(values), local, shared
    return rig


@pytest.mark.parametrize(
    ("turn", "values", "named"),
    [
        (0.0, [3.0, 0.0], False),  # the sensor alone does it, with one number
        (0.0, [3.0, 2.0], True),  # the sensor does half of it
        (0.0, [100.0, 6.0], True),  # the rest is far below what counts as noise as long as nothing is named
        (np.pi / 2, [3.0, 0.0], True),  # the sensor has nothing to do with it
    ],
)
def test_transient_that_one_sensor_imitates_is_not_named(turn, values, named):
    rig = with_burst(Imitated({}, burst=(TRIAL, 0.0, 2)), values)
    rig.turn = turn
    explanation = explain(search(rig))
    assert [f.candidate.cause for f in explanation.found] == (["push"] if named else [])


class InStep(FakeRig):
    """What imitates a lasting cause has a share of its trace, and a share of whatever the data hold."""

    share = 0.0

    def imitators(self, candidate):
        (k,) = (k for k, c in enumerate(self.catalogue) if c.key == candidate.key)
        return [
            [
                (1.0 - self.share) * rows.causes[k] + self.share * rows.residual[..., None]
                for rows in self.rows(self.catalogue)
            ]
        ]


@pytest.mark.parametrize(("share", "named"), [(0.0, True), (1.0, False)])
def test_lasting_cause_that_is_imitated_is_not_named(share, named):
    """The same trace tells no more than the cause; the data themselves do."""
    rig = InStep({2: 25.0})
    rig.share = share
    explanation = explain(search(rig))
    assert ("cause 2" in [f.candidate.cause for f in explanation.found]) is named


def test_wrong_torque_lasts_as_long_as_the_push():
    """Against the residual of a recording in which one spring read 0.2 N m too much for two seconds."""
    case = exact()
    start, lasting = 6.0, 2.0
    time = case.signals.time
    tau = case.signals.tau.copy()
    tau[(time >= start) & (time < start + lasting), 1, 2] += 0.2
    changed = residual_of(case, replace(case.signals, tau=tau)) - case.linear.residual
    unwhitened = [lambda x: x] * 2
    # A sample stands for half of its time before it.
    push = CAUSES["push"].event({}, Transient(1, start - 0.005, lasting))
    found = wrong_torques([case.linear] * 2, unwhitened, push)
    assert len(found) == 9
    for columns in found:
        assert not columns[0].any()
    np.testing.assert_allclose(0.2 * found[5][1][..., 0], changed, atol=2e-3 * np.abs(changed).max())
