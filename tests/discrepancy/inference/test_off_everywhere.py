"""Machines of which every kind is far off its tolerance: what is learnt, and what is named."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dense_evidence import dense_evidence, log_prior
from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.learn import learnt
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from discrepancy.result.sensitivity import detection_limits
from fake_rig import CHANNELS, ROWS, FakeRig, cause

KINDS, PLACES = 8, 3
LOOSE = KINDS * PLACES
"""The first place of the kind that leaves something open."""
CATALOGUE = tuple(cause(f"kind {k}", robot) for k in range(KINDS) for robot in (1, 2, 3)) + tuple(
    cause("loose", robot) for robot in (1, 2, 3)
)


@dataclass
class LooseRig(FakeRig):
    """Every kind is ``times`` its tolerance off, and loose places leave sixty numbers a trial open, of their size."""

    times: float = 10.0

    def __post_init__(self):
        super().__post_init__()
        off = np.random.default_rng(17).choice([-1.2, -0.8, 0.8, 1.2], LOOSE)
        for t, (x, *own) in enumerate(self.data):
            for k, candidate in enumerate(self.catalogue[:LOOSE]):
                x = x + self.columns_of[candidate.key][t] @ [self.times * off[k]]
            for k in range(LOOSE, LOOSE + PLACES):
                draw = np.random.default_rng([t, k]).standard_normal(60)
                x = x + self.present.get(k, 0.0) * self.unknowns(self.catalogue[k])[t].dense() @ draw
            self.data[t] = x, *own

    def unknowns(self, candidate):
        count = 60 if candidate.cause == "loose" else 0
        rng = np.random.default_rng([11, candidate.robot])
        return [Patches.of(0.1 * rng.standard_normal((ROWS, CHANNELS, count))) for _ in self.trials]


def diagnosed(present, times):
    return diagnose(LooseRig(present, catalogue=CATALOGUE, times=times), closed_loop=False)


@pytest.mark.parametrize("others", [{}, {LOOSE + 1: 6.0}, {LOOSE + 1: 6.0, LOOSE + 2: -11.0}])
def test_what_is_as_far_off_as_all_else_is_scatter_and_is_in_the_model(others):
    """However many places are."""
    diagnosis = diagnosed({LOOSE: 18.0, **others}, 10.0)
    explanation = diagnosis.explanation
    assert diagnosis.verdict == "miscalibrated"
    assert explanation.found == explanation.suspected == ()
    assert "loose" in {item.candidate.cause for item in explanation.scatter}
    assert explanation.clean
    # By how much every place is off is told, the farthest first; within a tolerance each is off besides.
    off = np.random.default_rng(17).choice([-1.2, -0.8, 0.8, 1.2], LOOSE)
    kinds = {item.candidate.cause: item for item in explanation.scatter}
    assert len(kinds) == KINDS + 1
    for k in range(KINDS):
        each = kinds[f"kind {k}"].each
        sizes = [abs(value[0]) for _, value, _ in each]
        assert sizes == sorted(sizes, reverse=True)
        assert sorted(place.robot for place, _, _ in each) == [1, 2, 3]
        for place, value, se in each:
            assert value[0] == pytest.approx(10.0 * off[PLACES * k + place.robot - 1], abs=3.0 + 4.0 * se[0])
            assert 0.0 < se[0] < 1.0
    # What they leave open is told by their law, though they are not named.
    assert {CATALOGUE[k].key for k in (LOOSE, *others)} <= set(explanation.problem.opened)
    value, covariance = explanation.fit.part(LOOSE)
    assert abs(value[0] - 18.0) < 4.0  # a tolerance off besides, as the rig draws it
    assert covariance[0, 0] < 1.0


def test_the_same_in_a_machine_within_its_tolerances_is_a_fault():
    diagnosis = diagnosed({LOOSE: 18.0}, 0.0)
    (found,) = diagnosis.causes
    assert found.candidate.key == CATALOGUE[LOOSE].key
    assert diagnosis.verdict == "explained"


def test_what_stands_out_of_all_else_is_named_and_the_rest_is_not():
    diagnosis = diagnosed({LOOSE: 300.0}, 10.0)
    (found,) = diagnosis.causes
    assert found.candidate.key == CATALOGUE[LOOSE].key
    assert found.values[0] == pytest.approx(300.0, abs=20.0)
    assert found.over_nothing > rules.NAMED_NATS


def test_evidence_holds_a_kind_against_the_middle_of_the_others(monkeypatch):
    """Of eight kinds: seven others, of which the fourth is the middle one; their priors by hand."""
    candidates = CATALOGUE[:LOOSE]
    sizes = np.repeat([6.0, 7.0, 8.0, 10.0, 11.0, 13.0, 15.0, 1.0], PLACES) * np.tile([1.0, -1.0, 1.0], KINDS)
    rig = FakeRig(dict(enumerate(sizes)), catalogue=candidates)
    rows = [
        replace(r, residual=r.residual - r.local @ own, local=r.local[..., :0])
        for r, own in zip(rig.rows(candidates), rig.own, strict=True)
    ]
    gaps = []
    for least in (rules.LEVEL_KINDS, np.inf):  # with levels, and with tolerances alone
        monkeypatch.setattr(rules, "LEVEL_KINDS", least)
        learned = learnt(Problem.of(rows, candidates))
        one, spread = learned.problem, learned.problem.spread[::PLACES]
        middle = [np.sort(np.delete(spread, k))[3] if least < np.inf else 1.0 for k in range(KINDS)]
        assert [learned.levels[f"kind {k}"].spread for k in range(KINDS)] == pytest.approx(middle)
        numbers = np.array([float(learned.levels[f"kind {k}"].numbers) for k in range(KINDS)])
        np.testing.assert_allclose(numbers, rules.SPREAD_NUMBERS + KINDS - 1, atol=0.1)  # all but all is told
        powers = log_prior(one, [])  # in the others, too
        by_level = [
            log_prior(one, [[PLACES * k]], spread=one.spread / m) - powers for k, m in enumerate(middle)
        ]
        by_level *= numbers / rules.SPREAD_NUMBERS
        alone = [log_prior(one, [[PLACES * k]]) - powers for k in range(KINDS)]
        prior = powers + np.sum(np.maximum(by_level, alone))
        gaps.append(learned.log_evidence - dense_evidence(rows, one, ()) - prior)
    assert gaps[1] == pytest.approx(gaps[0], abs=1e-6)


def test_a_limit_is_wider_where_all_is_off():
    """A fault of a kind that is told has to stand out of how far off all else is."""
    sizes = []
    for times in (0.0, 10.0):
        explanation = diagnosed({}, times).explanation
        limits = {
            (entry["cause"], entry["robot"]): entry["parameters"]["p0"]
            for entry in detection_limits(explanation)
        }
        sizes.append(limits["loose", 2])
    assert sizes[1] > 1.5 * sizes[0]
