"""What a cause is worth in closed loop: shares, intervals and bookkeeping by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from discrepancy.engine.gain import responses, with_all_as_found
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.team.gain import Gain, Response, mean_chi2
from estimator.errors import InputError
from fake_rig import FakeRig


def response(chi2):
    return Response({"phi": 1.0}, {"phi": 0.1}, chi2)


def gain(before, after, held_out=True):
    made = [tuple(None if x is None else response(x) for x in side) for side in (before, after)]
    return Gain(*made, held_out)


def test_interval_is_that_of_a_t_test():
    before, after = [10.0, 17.0, 5.0, 26.0], [2.0, 5.0, 1.04, 1.0]
    shares = [1 - 1 / 3, 1 - 2 / 4, 1 - 0.2 / 2, 1.0]
    mean, low, high = gain(before, after).removed()
    interval = stats.t.interval(0.95, 3, np.mean(shares), stats.sem(shares))
    assert mean == pytest.approx(np.mean(shares))
    assert low == pytest.approx(interval[0])
    assert high == pytest.approx(min(interval[1], 1.0))


def test_interval_ends_at_everything():
    _, low, high = gain([10.0, 10.0, 10.0], [1.0, 1.5, 1.0]).removed()
    assert high == 1.0
    assert low < 0.95


def test_worse_is_a_negative_share():
    assert gain([2.0, 2.0], [5.0, 5.0]).removed() == pytest.approx((-1.0, -1.0, -1.0))


def test_one_trial_has_no_interval():
    mean, low, high = gain([10.0], [2.0]).removed()
    assert (mean, low, high) == (pytest.approx(2 / 3), -np.inf, 1.0)


def test_failed_and_perfect_trials_do_not_count():
    both = gain([10.0, None, 10.0, 0.9], [2.0, 2.0, None, 0.8])
    assert len(both.pairs) == 2
    assert both.removed()[0] == pytest.approx(2 / 3)
    assert gain([None, 0.5], [1.0, 0.4]).removed() is None


def test_mean_of_a_failed_trial_is_infinite():
    assert mean_chi2([response(2.0), response(4.0)]) == 3.0
    assert mean_chi2([response(2.0), None]) == np.inf


class ThreeChannels(FakeRig):
    """Errors of known size in two channels."""

    def simulation(self, trial, shared, local, active, healthy=()):
        self.calls.append((trial, shared, local, [(c.cause, v) for c, v in active]))
        error = np.random.default_rng(trial).standard_normal((50, 2, 3)) * (1 + trial)
        return lambda: None if trial == 2 else {"phi": 0.01 * error, "tau": 5.0 * error}

    def response_scale(self, trial):
        each = np.arange(1.0, 7.0).reshape(2, 3)
        return {"phi": (0.01 * each, 0.1 * each), "tau": (5.0 * each, 20.0 * each)}


def test_responses_by_hand():
    rig = ThreeChannels({2: 25.0})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    told = []
    without, with_it = responses(rig, problem, [[], [2]], progress=told.append)
    assert sum(told) == 8
    assert without[2] is None
    assert with_it[2] is None
    each = np.arange(1.0, 7.0).reshape(2, 3)
    for t in (0, 1, 3):
        error = np.random.default_rng(t).standard_normal((50, 2, 3)) * (1 + t)
        assert without[t].rms["tau"] == pytest.approx(5.0 * np.sqrt(np.mean(error**2)))
        assert without[t].nrmse["phi"] == pytest.approx(
            0.01 * np.sqrt(np.mean(error**2) / np.mean((0.1 * each) ** 2))
        )
        assert without[t].chi2_per_n == pytest.approx(np.mean((error / each) ** 2))
        assert with_it[t] == without[t]


def test_only_what_can_be_is_simulated_again():
    """By what all the other trials say."""

    class FirstAndThird(ThreeChannels):
        resimulated = (0, 3)

    whole, some = ThreeChannels({2: 25.0}), FirstAndThird({2: 25.0})
    for rig in (whole, some):
        problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
        (answers,) = responses(rig, problem, [[2]])
        assert len(answers) == len(rig.resimulated)
    assert [call[0] for call in some.calls] == [0, 3]
    expected = [call for call in whole.calls if call[0] in (0, 3)]
    for one, other in zip(some.calls, expected, strict=True):
        np.testing.assert_array_equal(one[1], other[1])
        assert one[3] == other[3]


def test_unknowns_and_causes_of_a_simulation_come_from_the_other_trials():
    rig = ThreeChannels({2: 25.0})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    responses(rig, problem, [[], [2, 6]])
    for trial, shared, local, active in rig.calls:
        others = [k for k in range(4) if k != trial]
        free = [rig.catalogue.index(next(c for c in rig.catalogue if c.cause == name)) for name, _ in active]
        # Plain least squares of the other trials' rows, with every trial's own unknowns.
        blocks, right = [], []
        for place, k in enumerate(others):
            x, own, common = rig.data[k]
            columns = [common, *(rig.columns(rig.catalogue[i])[k] for i in free)]
            columns += [own * (place == q) for q in range(3)]
            blocks.append(np.concatenate(columns, axis=2).reshape(x.size, -1))
            right.append(x.ravel())
        solution = np.linalg.lstsq(np.concatenate(blocks), np.concatenate(right), rcond=None)[0]
        np.testing.assert_allclose(shared, -solution[:3], rtol=1e-7)
        for value, (_, got) in zip(solution[3 : 3 + len(free)], active, strict=True):
            assert got[0] == pytest.approx(value, rel=1e-7)
        x, own, common = rig.data[trial]
        left = x - common @ solution[:3]
        for i, value in zip(free, solution[3:], strict=False):
            left = left - rig.columns(rig.catalogue[i])[trial][..., 0] * value
        mine = np.linalg.lstsq(own.reshape(x.size, 2), left.ravel(), rcond=None)[0]
        np.testing.assert_allclose(local, -mine, rtol=1e-7)


def test_single_trial_predicts_itself():
    rig = ThreeChannels({2: 25.0}, trials=("only",))
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    responses(rig, problem, [[2]])
    assert rig.calls[0][3][0][1][0] == pytest.approx(Fit.of(problem, [2], background=False).part(2)[0][0])


class Whole(FakeRig):
    """A simulation that has healthy parts, and what they were off by when it was asked."""

    whole = True
    off = 5.0

    def simulation(self, trial, shared, local, active, healthy=()):
        self.calls.append((trial, shared, {c.cause: v for c, v in (*active, *healthy)}))
        return lambda: {"phi": np.full((10, 3), 1.0 if healthy else self.off)}


def test_healthy_parts_are_as_the_other_trials_find_them():
    rig = Whole({2: 25.0})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    before, after = responses(rig, problem, [[], [2]])
    rig.calls.clear()
    gain = with_all_as_found(Gain(before, after, held_out=True), rig, problem, [2])
    assert [one.chi2_per_n for one in gain.as_found] == [1.0] * 4
    for trial, shared, values in rig.calls:
        # Least squares of the other trials' rows with a row for every tolerance, none for the cause.
        rows, right, place = [], [], 0
        for t, (x, own, common) in enumerate(rig.data):
            if t != trial:
                nuisance = np.zeros((*x.shape, 6))
                nuisance[..., 2 * place : 2 * place + 2], place = own, place + 1
                causes = [rig.columns_of[c.key][t] for c in rig.catalogue]
                rows.append(np.concatenate([nuisance, common, *causes], axis=2).reshape(x.size, -1))
                right.append(x.ravel())
        prior = np.diag(
            [0.0] * 9 + [0.0 if c.cause == "cause 2" else 1.0 for c in rig.catalogue for _ in c.parameters]
        )
        A, b = np.concatenate([*rows, prior]), np.concatenate([*right, np.zeros(len(prior))])
        solution = np.linalg.lstsq(A, b, rcond=None)[0]
        np.testing.assert_allclose(-shared, solution[6:9], rtol=1e-6)
        found = np.concatenate([values[c.cause] for c in rig.catalogue])
        np.testing.assert_allclose(found, solution[9:], rtol=1e-6, atol=1e-9)


def test_nothing_is_asked_for_where_only_noise_is_left_or_a_simulation_cannot_have_such_parts():
    quiet, plain, failed = Whole({}), Whole({}), Whole({})
    quiet.off, plain.whole = 1.5, False
    for rig in (quiet, plain, failed):
        problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
        (before,) = responses(rig, problem, [[]])
        before = (None,) * 4 if rig is failed else before
        gain = Gain(before, before, held_out=True)
        assert with_all_as_found(gain, rig, problem, []) is gain


@pytest.mark.parametrize(
    ("found", "better"), [((2.0, 3.0), True), ((5.0, 6.0), False), ((2.0, None), False), ((), False)]
)
def test_a_model_as_found_is_better_if_all_its_trials_are_told_and_together_better(found, better):
    told = gain([40.0, 50.0], [5.0, 6.0])
    told = replace(told, as_found=tuple(None if x is None else response(x) for x in found))
    assert told.is_better_as_found is better


def test_rigs_that_have_no_such_model_say_so(tmp_path):
    with pytest.raises(InputError, match="a team only"):
        FakeRig({}).write_as_found(None, tmp_path / "as_found")
    assert not (tmp_path / "as_found").exists()
