"""Effects hidden by the simulator, found by the small engine, whose rows and columns know nothing of it."""

from collections.abc import Sequence

import numpy as np
import pytest

from discrepancy.evidence.odds import odds_of
from discrepancy.team.diagnose import TeamOutcome, search_team
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from hidden_quick import generated, quick_set

HIDDEN = [
    quick_set("single", 1, "link_length", payload="a"),
    quick_set("single", 4, "grasp_flex", payload="d"),
    quick_set("single", 5, "drag", payload="a"),
    quick_set("single", 7, "payload_mass", payload="b"),
]


def searched(recordings: Sequence[Recording]) -> TeamOutcome:
    """What the engine finds in some recordings."""
    estimate = estimate_payload(recordings, compare_masses=False, withhold=False)
    return search_team(TeamRig.of(recordings, estimate, read_tolerances(None)))


@pytest.mark.slow
@pytest.mark.parametrize("request_", HIDDEN, ids=lambda request: request.causes[0])
def test_a_hidden_effect_is_found_and_nothing_besides(request_) -> None:
    recordings, sealed = generated(request_)
    outcome = searched(recordings)
    (effect,) = sealed.open({"found": [chosen.group.cause for chosen in outcome.state.chosen]})["effects"]
    (chosen,) = outcome.state.chosen
    found = outcome.problem.candidates[chosen.group.identity]
    assert (found.cause, found.robot, found.joint) == (effect["cause"], effect.get("robot"), effect.get("joint"))
    (odds,) = odds_of(outcome.search, outcome.state)
    assert odds.probability > 0.9
    values = outcome.problem.values_of(chosen.group, outcome.state.posterior.mean)
    for parameter, value in zip(found.parameters, values, strict=True):
        true = effect["parameters"].get(parameter.name)
        if true and parameter.name.startswith(("proximal", "compliance", "coefficient", "mass")):
            assert value == pytest.approx(true, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["clean", "tolerance"])
def test_nothing_is_found_where_nothing_is_hidden(kind) -> None:
    outcome = searched(generated(quick_set(kind, 6, payload="b"))[0])
    assert not outcome.state.chosen
    assert np.all(outcome.state.posterior.variance < 2.5)
