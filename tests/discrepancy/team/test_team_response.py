"""What a search of a team found: in closed loop, as a model to take away, and held against other parts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import mocobot
from discrepancy.evidence.probability import Odds, Rival
from discrepancy.evidence.search import Chosen
from discrepancy.team import long
from discrepancy.team.causes import CAUSES, read_tolerances
from discrepancy.team.closed_loop import mean_chi2
from discrepancy.team.diagnose import TeamOutcome, search_team
from discrepancy.team.long import Choice, search_parts
from discrepancy.team.response import confirm, left_by, write_model
from discrepancy.team.rig import TeamRig
from estimator.estimate.payload import estimate_payload
from hidden_team import recorded
from mocobot_sim.effects import make_effect
from mocobot_sim.extended.extended import load_extended

ROBOT, JOINT, BIAS_NM = 3, 2, 0.25


def searched(recordings, *causes: str) -> TeamOutcome:
    """A search for some causes only, to save time."""
    left_out = [name for name in CAUSES if name not in causes]
    estimate = estimate_payload(recordings, compare_masses=False, withhold=False)
    return search_team(TeamRig.of(recordings, estimate, read_tolerances(None), left_out))


@cache
def hidden() -> TeamOutcome:
    """A torque that is off by a constant, a dozen tolerances large, among healthy parts."""
    effect = make_effect("sea_bias", {"bias_Nm": BIAS_NM}, ROBOT, JOINT)
    return searched(recorded("b", [effect], seed=2), "sea_bias", "phi_zero")


def group_at(outcome: TeamOutcome, robot: int, joint: int):
    """The constant error of a torque."""
    (own,) = (g for g in outcome.problem.groups if g.key == ("sea_bias", f"robot {robot}, joint {joint}"))
    return own


def odds_with(chosen: Chosen, rival) -> list[Odds]:
    """As if the rows could not tell two causes."""
    return [Odds(chosen, 0.6, 30.0, (Rival(rival, 0.4), Rival(None, 0.0)))]


def test_the_true_cause_responds_better_than_none_and_than_another() -> None:
    """Fitted to the other trial; the other cause is no look-alike any more."""
    outcome = hidden()
    (chosen,) = outcome.state.chosen
    assert chosen.group is group_at(outcome, ROBOT, JOINT)
    other = group_at(outcome, ROBOT % 3 + 1, JOINT)
    found = confirm(outcome, odds_with(chosen, other))
    assert found.gain.held_out
    assert len(found.gain.pairs) == 2
    assert all(after.chi2_per_n < before.chi2_per_n for before, after in found.gain.pairs)
    assert not found.contradicted
    assert found.notes == ()
    assert found.outcome is outcome
    assert found.tried[chosen.group.key, other.key] > mean_chi2(found.gain.after)
    (odds,) = found.odds
    assert odds.told() == (chosen.group,)
    assert odds.probability + sum(r.probability for r in odds.rivals) == pytest.approx(1.0)


def test_a_rival_that_responds_better_takes_the_place() -> None:
    outcome = hidden()
    (chosen,) = outcome.state.chosen
    wrong = group_at(outcome, ROBOT % 3 + 1, JOINT)
    state = outcome.search.value([Chosen(wrong, chosen.scale)], outcome.state.posterior)
    found = confirm(replace(outcome, state=state), odds_with(state.chosen[0], chosen.group))
    assert [c.group for c in found.outcome.state.chosen] == [chosen.group]
    (odds,) = found.odds
    assert odds.chosen is found.outcome.state.chosen[0]
    assert odds.told() == (chosen.group,)
    assert odds.rivals[0].group is wrong
    (note,) = found.notes
    assert "in closed loop the latter does better" in note


def test_a_cause_that_responds_worse_is_contradicted(monkeypatch: pytest.MonkeyPatch) -> None:
    """One whose effect no simulation can have."""
    outcome = hidden()
    (chosen,) = outcome.state.chosen
    monkeypatch.setattr(TeamRig, "effects", lambda self, candidate, values: None)
    found = confirm(outcome, [Odds(chosen, 1.0, 30.0, ())])
    assert found.contradicted
    assert found.odds[0].probability == 0.5
    assert found.odds[0].told() == (chosen.group,)
    assert "cannot be simulated with the recorded commands, which speaks against it." in found.notes[0]


def test_models_to_take_away(tmp_path) -> None:
    """Both have the cause; the one as found has healthy parts besides."""
    outcome = hidden()
    for whole in (False, True):
        write_model(outcome, outcome.state.chosen, tmp_path / f"{whole}", whole=whole)
        scene = load_extended(tmp_path / f"{whole}")
        off = scene.units[ROBOT - 1].tau_zero_Nm[JOINT - 1]
        assert off == pytest.approx(BIAS_NM, rel=0.1)
        causes = [effect.cause for effect in scene.effects]
        assert causes[0] == "sea_bias"
        assert ("phi_zero" in causes) == whole


def test_what_is_in_another_part_calls_for_its_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """A torque is wrong in the last part only, which was not searched at first."""
    for owner, name, value in (
        (long, "WHOLE_S", 16.0), (long, "SEARCHED_S", 16.0), (long, "SHORTEST_PART_S", 8.0),
        (long, "ODD_WINDOW_S", 2.0),
    ):  # fmt: skip
        monkeypatch.setattr(owner, name, value)
    recording = mocobot.simulate("b", "random", vias=16, seed=6)
    choice = Choice.of([recording])
    odd = choice.others[-1]
    tau = recording.tau.copy()
    tau[np.searchsorted(recording.time, choice.parts[odd].time[300]) :, 1, 0] += 0.5
    choice = Choice.of([replace(recording, tau=tau)])
    said: list[str] = []
    taken, found, _ = search_parts(choice, lambda some: searched(some, "phi_zero"), left_by, said.append)
    assert odd not in choice.taken
    assert odd in taken.taken
    assert choice.parts[odd].name in found.problem.rig.trials
