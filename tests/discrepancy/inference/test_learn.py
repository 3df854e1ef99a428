"""Powers of the noise and spreads of kinds: their evidence against a dense normal density, what is learnt of draws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space

from dense_evidence import dense_evidence, log_prior
from discrepancy import rules
from discrepancy.candidate import Candidate, Parameter
from discrepancy.inference.learn import learnt, worth_spreads
from discrepancy.inference.twins import twins
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rows
from linear_problem import cosines, random_rows, with_residuals


def place(cause, joint, tolerance=0.5, parameters=1):
    listed = tuple(Parameter(f"p{k}", tolerance, 2.0) for k in range(parameters))
    return Candidate(cause, cause, 1, joint, listed)


CANDIDATES = (
    *(place("many", joint) for joint in (1, 2, 3)),
    place("single", 1, parameters=2),
    place("event", 1, tolerance=0.0),
    place("pair", 1, parameters=2),
    place("pair", 2, parameters=2),
)
HYPOTHESES = [(), (1,), (4,), (3, 0), (6, 4)]


def kinds_beside(free):
    """Indices of the candidates of every kind that scatters, what is free left out."""
    kinds = {}
    for index, candidate in enumerate(CANDIDATES):
        if index not in free and candidate.parameters[0].tolerance:
            kinds.setdefault(candidate.cause, []).append(index)
    return list(kinds.values())


@pytest.fixture
def rng():
    return np.random.default_rng(31)


@pytest.fixture
def rows(rng):
    """Noise of more power in the second group of channels, a kind that scatters, a fault."""
    rows = random_rows(rng, n=24, local=0, candidates=CANDIDATES, moving=21, groups=[0, 0, 1])
    values = [3.0 * rng.standard_normal(1) for _ in range(3)]
    values += [np.array([0.4, -0.2]), np.array([4.0]), np.array([0.2, 0.3]), np.array([5.0, 4.0])]
    residuals = []
    for r in rows:
        x = r.residual.copy()
        x[:, 2] *= 2.0
        residuals.append(x + sum(a @ v for a, v in zip(r.causes, values, strict=True)))
    return with_residuals(rows, residuals)


def test_log_evidence_is_that_of_a_dense_normal(rows):
    """With its priors, up to a constant that all hypotheses share."""
    problem = Problem.of(rows, CANDIDATES)
    gaps = []
    for free in HYPOTHESES:
        one = learnt(problem, free)
        dense = dense_evidence(rows, one.problem, free) + log_prior(one.problem, kinds_beside(free))
        gaps.append(one.log_evidence - dense)
    np.testing.assert_allclose(gaps, gaps[0], atol=1e-6)
    size = sum(r.residual.size for r in rows)
    assert gaps[0] == pytest.approx(0.5 * size * np.log(2 * np.pi), abs=1e-6)


def without_own(rows):
    """The rows' numbers that no own unknown can change, one after the other, alone."""
    out = []
    for r in rows:
        seen = null_space(r.local.reshape(r.residual.size, -1).T)
        of = lambda x, n=seen: (n.T @ x.reshape(len(n), -1)).reshape(n.shape[1], 1, -1)  # noqa: E731
        causes = [of(x) for x in r.causes]
        residual = of(r.residual)[..., 0]
        out.append(
            Rows(r.name, residual, of(r.local)[..., :0], of(r.shared), causes, np.arange(len(residual)), 0)
        )
    return out


def test_trials_own_unknowns_spend_numbers_of_their_cells(rng):
    """Powers and evidence are those of what no own unknown can change (Patterson and Thompson, Biometrika 58, 1971)."""
    rows = random_rows(rng, n=14, channels=2, local=9, candidates=CANDIDATES, moving=0)
    rows = with_residuals(rows, [scale * r.residual for scale, r in zip((0.7, 3.0, 6.0), rows, strict=True)])
    seen = without_own(rows)
    problem, alone, gaps = Problem.of(rows, CANDIDATES), Problem.of(seen, CANDIDATES), []
    for free in HYPOTHESES:
        one, other = learnt(problem, free), learnt(alone, free)
        for power, own, c in zip(one.problem.power, other.problem.power, problem.cells, strict=True):
            np.testing.assert_allclose(power[c.sizes > 0], own[c.sizes > 0], rtol=1e-6)
        noise = [p[-1] * np.eye(r.residual.size) for p, r in zip(other.problem.power, seen, strict=True)]
        dense = dense_evidence(seen, other.problem, free, noise=noise)
        gaps.append(one.log_evidence - dense - log_prior(other.problem, kinds_beside(free)))
    np.testing.assert_allclose(gaps, gaps[0], atol=1e-6)


def test_what_is_left_open_has_the_evidence_of_its_covariance(rng, rows, monkeypatch):
    """At noise of unit power, whose prior is made as good as certain."""
    monkeypatch.setattr(rules, "POWER_NUMBERS", 1e12)
    U = [rng.standard_normal((*r.residual.shape, 4)) for r in rows]
    problem = Problem.of(rows, CANDIDATES)
    opened = problem.with_unknowns(("event", 1, 1), list(map(Patches.of, U)), 0.8)
    dense_noise = []
    for u in U:
        flat = 0.8 * u.reshape(-1, 4)
        dense_noise.append(np.eye(len(flat)) + flat @ flat.T)
    gaps = []
    for of, noise in ((problem, None), (opened, dense_noise)):
        one = learnt(of, (4,))
        dense = dense_evidence(rows, one.problem, (4,), noise=noise)
        gaps.append(one.log_evidence - dense - log_prior(one.problem, kinds_beside((4,))))
    assert gaps[1] == pytest.approx(gaps[0], abs=1e-4)  # the stiff prior rounds at 1e-4


@pytest.mark.parametrize("free", [(), (4, 0)])
def test_what_is_learnt_is_stationary(rows, free, monkeypatch):
    """Slopes of the dense evidence with its priors, by logarithms: nought; at a bound, outwards."""
    monkeypatch.setattr(rules, "LEARN_NATS", 1e-11)
    one = learnt(Problem.of(rows, CANDIDATES), free, 400).problem

    def slope(of):
        return (of(1e-4) - of(-1e-4)) / 2e-4

    def at(power=None, spread=None):
        kinds = kinds_beside(free)
        return dense_evidence(rows, one, free, power, spread) + log_prior(one, kinds, power, spread)

    for t, cells in enumerate(one.cells):
        for k in np.flatnonzero(cells.sizes):

            def moved(step, t=t, k=k):
                power = [p.copy() for p in one.power]
                power[t][k] *= np.exp(step)
                return at(power=power)

            if one.power[t][k] > rules.LEAST_POWER:
                # Of a single number that unknowns spend in part, one counts as left.
                assert slope(moved) == pytest.approx(0.0, abs=2e-3 if cells.sizes[k] > 1 else 0.05)
            else:
                assert slope(moved) < 0
    bounded = 0
    for members in [*kinds_beside(free), *([i] for i in free)]:
        at_columns = np.concatenate([np.r_[one.columns_of(i)] for i in members])

        def spread_moved(step, at_columns=at_columns):
            spread = one.spread.copy()
            spread[at_columns] *= np.exp(step)
            return at(spread=spread)

        value = one.spread[at_columns[0]]
        if len(members) == 1 and members[0] not in free:
            assert value == 1.0  # one of a kind cannot scatter
            bounded += 1
        elif value == 1.0 or value == rules.LEAST_SLAB:
            assert slope(spread_moved) < 0
            bounded += 1
        else:
            assert slope(spread_moved) == pytest.approx(0.0, abs=2e-3)
    assert bounded < len(kinds_beside(free)) + len(free)


def nine_places(rng, values, rows=60):
    return drawn(rng, tuple(place("many", joint, 0.5) for joint in range(1, 10)), values, rows)


def test_a_kind_that_scatters_is_learnt_as_chi_square_allows(rng):
    """Nine places with five times their tolerance; the prior counts as so many more within it."""
    squares, prior = [], rules.SPREAD_NUMBERS
    for _ in range(40):
        values = 5.0 * 0.5 * rng.standard_normal(9)
        spread = learnt(nine_places(rng, values)).problem.spread
        assert len(set(spread)) == 1
        expected = (np.sum((values / 0.5) ** 2) + prior) / (9 + prior)
        assert spread[0] ** 2 == pytest.approx(
            expected, rel=0.15
        )  # noise moves values by a fifth of a tolerance
        squares.append(((9 + prior) * spread[0] ** 2 - prior) / 9)
    assert np.mean(squares) == pytest.approx(25.0, abs=3.0 * 25.0 * np.sqrt(2.0 / (9 * 40)))


NINE = tuple(replace(place("many", joint, 0.5), family="rubs") for joint in range(1, 10))


def drawn(rng, candidates, values, rows=60):
    """Noise, and candidates of these values."""
    causes = [rng.standard_normal((rows, 2, 1)) for _ in candidates]
    x = rng.standard_normal((rows, 2)) + sum(c[..., 0] * v for c, v in zip(causes, values, strict=True))
    none = np.zeros((rows, 2, 0))
    return Problem.of([Rows("a", x, none, none, causes, np.arange(rows) / 10.0)], candidates)


@pytest.mark.parametrize(
    ("times", "family", "hidden"),
    [(8.0, "rubs", False), (8.0, "else", False), (8.0, "rubs", True), (0.5, "rubs", False)],
)
def test_one_of_a_kind_is_as_far_off_as_its_family(rng, times, family, hidden):
    values = times * 0.5 * rng.standard_normal(9)
    one = replace(place("single", 1, 0.5), family=family, hidden=hidden)
    candidates = (*NINE, *(place("other", joint, 0.5) for joint in (1, 2, 3)), one)
    spread = learnt(drawn(rng, candidates, [*values, 20.0, -20.0, 20.0, 0.0])).problem.spread
    assert spread[9] > 8.0  # of another family
    assert spread[-1] == (1.0 if hidden or family == "else" else spread[0])
    assert (spread[0] > 4.0) == (times > 1.0)


def test_one_of_a_kind_is_as_far_off_as_most_of_its_family(rng):
    """Nine places that are well known count for more than one more place of a fault."""
    two = [replace(place("few", joint, 0.5), family="rubs") for joint in (1, 2)]
    candidates = (*NINE, *two, replace(place("single", 1, 0.5), family="rubs"))
    values = [*(0.2 * rng.standard_normal(9)), 40.0, -0.1, 0.0]
    spread = learnt(drawn(rng, candidates, values)).problem.spread
    assert spread[9] > 10.0
    assert spread[-1] == spread[0] < 1.5


def test_a_kind_within_its_tolerance_does_not_scatter(rng):
    wanted = []
    for _ in range(20):
        one = learnt(nine_places(rng, 0.5 * rng.standard_normal(9)))
        assert one.problem.spread[0] < 1.6
        wanted.append(worth_spreads(one, ["many"])["many"])
    assert min(wanted) > -1e-6
    assert max(wanted) < rules.NAMED_NATS


def test_worth_of_a_spread_is_the_evidence_over_that_without(rng):
    problem = nine_places(rng, 3.0 * rng.standard_normal(9))
    one = learnt(problem)
    rows = [
        Rows(
            "a",
            problem.raw_columns(0, slice(-1, None))[..., 0],
            *(np.zeros((60, 2, 0)),) * 2,
            (),
            np.arange(60) / 10.0,
        )
    ]
    held = np.ones(9)
    expected = dense_evidence(rows, one.problem, ()) - dense_evidence(rows, one.problem, (), spread=held)
    expected += log_prior(one.problem, [list(range(9))]) - log_prior(
        one.problem, [list(range(9))], spread=held
    )
    assert worth_spreads(one, ["many"])["many"] == pytest.approx(expected, abs=1e-6)
    assert expected > 20.0
    assert worth_spreads(one, ["another"])["another"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("variance", "expected"), [(3.0, 3.0), (0.1, rules.LEAST_POWER)])
def test_power_of_a_cell_is_learnt(rng, variance, expected):
    """Noise of another variance above half of the highest frequency in one group of channels."""
    n = 512
    x = rng.standard_normal((n, 2))
    x[:, 1] = cosines(n).T @ (
        np.where(np.arange(n) >= n / 2, np.sqrt(variance), 1.0) * (cosines(n) @ x[:, 1])
    )
    none = np.zeros((n, 2, 0))
    rows = Rows("a", x, none, none, (), np.arange(n) / 10.0, None, (0, 1))
    (power,) = learnt(Problem.of([rows], ())).problem.power
    loud = 2 * rules.CELL_BANDS  # last octave of the second group
    prior, numbers = rules.POWER_NUMBERS, n / 2
    if expected > rules.LEAST_POWER:
        expected = (expected * numbers + prior) / (numbers + prior)
    assert power[loud] == pytest.approx(
        expected, abs=4.0 * expected * np.sqrt(2.0 / numbers) * (variance > 1)
    )
    others = np.delete(power, [loud])
    np.testing.assert_allclose(others, 1.0, atol=0.6)


def test_own_spread_of_what_is_there_is_its_size(rng):
    """Of one number its distance from nought, and never less than a slab."""
    problem = nine_places(rng, [0.5 * 40.0, *np.zeros(8)])
    free = learnt(problem, (0,)).problem
    assert free.spread[0] == pytest.approx(40.0, rel=0.05)
    assert free.spread[1] == pytest.approx(1.0, abs=0.01)
    assert learnt(problem, (3,)).problem.spread[3] == rules.LEAST_SLAB


def test_learning_starts_anywhere(rows):
    problem = Problem.of(rows, CANDIDATES)
    far = replace(problem, spread=20.0 * problem.spread, power=tuple(4.0 * p for p in problem.power))
    assert learnt(far).log_evidence == pytest.approx(learnt(problem).log_evidence, abs=4 * rules.LEARN_NATS)


def with_twins(rng, values, rows=60):
    """Two kinds of five places with the same columns, and a third that is apart."""
    candidates = tuple(place(kind, joint) for kind in ("one", "other", "apart") for joint in range(1, 6))
    columns = [rng.standard_normal((rows, 2, 1)) for _ in range(10)]
    causes = [*columns[:5], *(-c for c in columns[:5]), *columns[5:]]
    x = rng.standard_normal((rows, 2)) + sum(c[..., 0] * v for c, v in zip(columns, values, strict=False))
    none = np.zeros((rows, 2, 0))
    return [Rows("a", x, none, none, causes, np.arange(rows) / 10.0)], candidates


def test_of_two_kinds_with_one_trace_one_scatters(rng):
    """Half of it each is a fixed point, too, but a saddle; the likeliest spreads are those of a grid."""
    rows, candidates = with_twins(rng, 20.0 * 0.5 * rng.standard_normal(5))
    problem = Problem.of(rows, candidates)
    one = learnt(problem)
    spreads = one.problem.spread[[0, 5]]
    assert min(spreads) < 1.1
    assert max(spreads) > 2.0

    def judged(first, second):
        spread = np.array(one.problem.spread)
        spread[:5], spread[5:10] = first, second
        kinds = [[*range(k, k + 5)] for k in (0, 5, 10)]
        return dense_evidence(rows, one.problem, (), spread=spread) + log_prior(
            one.problem, kinds, spread=spread
        )

    grid = np.geomspace(1.0, 50.0, 18)
    best = max(judged(a, b) for a in grid for b in grid)
    assert judged(*spreads) > best - 0.1
    assert best - max(judged(a, a) for a in grid) > 1.0


def test_twins_are_kinds_of_the_same_columns_at_every_place(rng):
    rows, candidates = with_twins(rng, np.ones(5))
    problem = Problem.of(rows, candidates)
    assert twins(problem, ["one", "other", "apart"]) == [("one", "other")]
    assert twins(problem, ["one", "apart"]) == []
    rows[0].causes[7][:] += 0.01 * rng.standard_normal((60, 2, 1))  # of one place
    assert twins(Problem.of(rows, candidates), ["one", "other", "apart"]) == []
