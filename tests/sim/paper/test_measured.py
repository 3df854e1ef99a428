"""Chi-squares of Tables II-V: their distribution over drawn experiments, and what they are without any difference."""

from __future__ import annotations

import numpy as np
import pytest

from mocobot_sim.paper import measured
from mocobot_sim.paper.experiment import PaperPlan, scattering
from mocobot_sim.paper.measured import ENTRIES, agreement, effective_freedom, format_agreement, simulated
from mocobot_sim.paper.scoring import PAYLOADS, published_errors

PATHS = [path for paths in ENTRIES.values() for path in paths]
TEAM, TRIAL = 3.0, 2.0
"""Standard deviations of an entry over teams and over trials; far above the rounding of the published numbers."""
SPREAD = {
    table: {"freedom": 99.0, **dict.fromkeys(PAYLOADS, [TEAM] * len(paths))}
    for table, paths in ENTRIES.items()
}


def drawn(rng: np.random.Generator, trials: int, scale: float = 1.0) -> dict:
    """Scores of one team: every entry has a mean of its own, and trials scatter around it."""
    scores = {}
    for payload in PAYLOADS:
        entries: dict = {"all": {}}
        for path in PATHS:
            values = 50.0 + TEAM * rng.standard_normal() + scale * TRIAL * rng.standard_normal(trials)
            found = {"mean": float(values.mean()), "std": float(values.std(ddof=1))}
            if path in ENTRIES["IV"]:
                found = 50.0 + TEAM * rng.standard_normal()
            into = entries["all"] if path.startswith("all.") else entries
            into[path.removeprefix("all.")] = found
        scores[payload] = entries
    return scores


@pytest.mark.parametrize("trials", [6, 12])
def test_alike_teams_give_chi_squares_of_their_degrees_of_freedom(monkeypatch, trials):
    """400 experiments: means of both, and the scatter of six trials against that of ``trials``."""
    rng, found = np.random.default_rng(trials), []
    for _ in range(400):
        theirs = drawn(rng, 6)
        monkeypatch.setattr(measured, "published_errors", theirs.__getitem__)
        found.append(agreement(drawn(rng, trials), trials, True, SPREAD))
    for k, table in enumerate(ENTRIES):
        tables = [one[k] for one in found]
        assert {one.table for one in tables} == {table}
        entries = tables[0].entries
        assert entries == 4 * len(ENTRIES[table])
        assert np.mean([one.means for one in tables]) == pytest.approx(entries, rel=0.07)
        assert np.mean([one.means_p < 0.1 for one in tables]) == pytest.approx(0.1, abs=0.04)
        if table == "IV":
            assert tables[0].scatter is None
            continue
        assert tables[0].scatters == entries
        assert np.mean([one.scatter for one in tables]) == pytest.approx(entries, rel=0.07)
        assert np.mean(np.log([one.ratio for one in tables])) == pytest.approx(
            0.0 if trials == 6 else -0.06, abs=0.02
        )


def test_a_scatter_that_is_too_small_is_seen(monkeypatch):
    rng = np.random.default_rng(3)
    theirs = drawn(rng, 6)
    monkeypatch.setattr(measured, "published_errors", theirs.__getitem__)
    for one in agreement(drawn(rng, 6, 0.2), 6, True, SPREAD):
        if one.scatter is not None:
            assert one.scatter_p is not None
            assert one.scatter_p < 1e-6
            assert one.ratio == pytest.approx(5.0, rel=0.4)
            assert one.means_p > 1e-3


def test_the_published_numbers_agree_with_themselves_and_robots_as_designed_have_no_spread():
    scores = {payload: published_errors(payload) for payload in PAYLOADS}
    same = agreement(scores, 6, True)
    assert [(one.means, one.scatter, one.ratio) for one in same] == [
        (0.0, None if one.table == "IV" else 0.0, None if one.table == "IV" else 1.0) for one in same
    ]
    exact = {
        p: {k: v if k == "all" else {"mean": 0.0, "std": None} for k, v in scores[p].items()} for p in scores
    }
    (two, *_) = agreement(exact, 6, False)
    expected = sum(e["mean"] ** 2 / (e["std"] ** 2 / 6 + 0.01**2 / 12) for p in PAYLOADS
                   for e in (published_errors(p)[k] for k in ENTRIES["II"]))  # fmt: skip
    assert two.means == pytest.approx(expected, rel=1e-12)
    assert two.freedom == two.entries == 12
    text = format_agreement({"copy": same})
    assert [line.split()[0] for line in text.splitlines()[4:]] == list(ENTRIES)


def test_correlated_entries_count_less():
    rng = np.random.default_rng(0)
    independent = rng.standard_normal((400, 10))
    assert effective_freedom(independent) == pytest.approx(10.0, rel=0.05)
    shared = np.repeat(rng.standard_normal((400, 2)), 5, axis=1)
    assert effective_freedom(shared) == pytest.approx(2.0, rel=0.02)


def test_scattering_effects_differ_between_trials_only_where_they_are_drawn():
    assert "scattered" in PaperPlan().presets
    keys = [
        (p, kind, k)
        for p in PAYLOADS
        for kind, count in (("random", 6), ("static", 1), ("periodic", 3))
        for k in range(count)
    ]
    every = [scattering(*key) for key in keys]
    assert {effect.cause for effect in every[0]} == set(simulated()["effects"])
    draws = [tuple(getattr(effect, "draw", None) for effect in effects) for effects in every]
    if any(draw is not None for draw in draws[0]):
        assert len(set(draws)) == len(keys)
    assert len(
        {(effect.cause, *(getattr(effect, n) for n in effect.place_names())) for effect in every[0]}
    ) == len(every[0])
