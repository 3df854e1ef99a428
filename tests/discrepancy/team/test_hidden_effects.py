"""Effects hidden by the simulator, found by a diagnosis that does not know what was hidden."""

import ast
from pathlib import Path

import numpy as np
import pytest

import discrepancy.team.causes
import mocobot_sim.effects
from discrepancy.evidence.settings import SETTINGS
from discrepancy.team.causes import CAUSES
from hidden.draw import ground_of
from hidden.generator import generate
from hidden.limits import LIMITS, pendulum_limit_kg
from hidden.sealed import Sealed
from hidden_quick import blind, generated, quick_set, tiny_set
from mocobot.campaign.draw import draw_effect
from mocobot.campaign.summary import match
from mocobot_sim.effects import EFFECTS

HIDDEN = [
    quick_set("single", 1, "link_length", payload="a"),
    quick_set("single", 2, "sea_bias", payload="b"),
    quick_set("single", 3, "clock_delay", payload="c"),
    quick_set("single", 4, "grasp_flex", payload="d"),
    quick_set("single", 5, "drag", payload="a"),
    quick_set("single", 7, "payload_mass", payload="b"),
]


@pytest.mark.slow
@pytest.mark.parametrize("request_", HIDDEN, ids=lambda request: request.causes[0])
def test_hidden_effect_is_named(request_):
    verdict, truth = blind(request_)
    found = match(verdict["causes"], truth, [request_.factor])
    (one,) = found.scores
    assert [item["cause"] for item in verdict["causes"]] == list(request_.causes)
    assert one.member
    assert one.place
    assert one.error < 0.2
    assert not found.extras
    assert verdict["residual"]["chi2_per_n"] < verdict["residual"]["nominal"]["chi2_per_n"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["clean", "tolerance"])
def test_nothing_is_named_where_nothing_is_hidden(kind):
    verdict, truth = blind(quick_set(kind, 6, payload="b"))
    assert truth["effects"] == []
    assert (len(truth["background"]) > 100) == (kind == "tolerance")
    assert verdict["causes"] == []
    assert verdict["residual"]["chi2_per_n"] < SETTINGS.clean_chi2


@pytest.mark.slow
def test_without_the_true_cause_only_its_family_is_named():
    request = HIDDEN[1]
    verdict, truth = blind(request, excluded=request.causes, laws="never")
    family = CAUSES[truth["effects"][0]["cause"]].family
    assert "sea_bias" not in [item["cause"] for item in verdict["causes"]]
    assert all(item["family"] == family for item in verdict["causes"][:1])


def test_equal_requests_give_equal_bits():
    first, second = generated(tiny_set(3)), generate(tiny_set(3))
    assert first[1].open({}) == second[1].open({})
    assert all((a.tau == b.tau).all() for a, b in zip(first[0], second[0], strict=True))
    other = generated(tiny_set(4))
    assert other[1].open({}) != first[1].open({})


def test_recordings_do_not_say_what_is_hidden():
    recordings, _ = generated(tiny_set(3))
    assert len(recordings) == 2
    for recording in recordings:
        assert not [cause for cause in EFFECTS if cause in recording.metadata.to_json() + recording.name]


def test_truth_is_sealed_without_a_verdict():
    with pytest.raises(ValueError, match="sealed"):
        Sealed({"effects": []}).open(None)


def test_pendulum_is_measured_by_the_limit_of_its_own_length():
    """A slow one is hardly excited, and has to be twice as heavy to be seen."""
    assert pendulum_limit_kg(0.2) == LIMITS["slosh"]["mass_kg"]
    assert pendulum_limit_kg(0.5) > 1.9 * LIMITS["slosh"]["mass_kg"]
    ground = ground_of(3, np.zeros(3), [])
    for seed in range(5):
        effect = draw_effect("slosh", 4.0, ground, np.random.default_rng(seed))
        assert effect.mass_kg == pytest.approx(4.0 * pendulum_limit_kg(effect.length_m))


def test_every_cause_has_a_limit_and_an_effect():
    assert set(LIMITS) == set(CAUSES) == set(EFFECTS) - {"law"}


def imports(package) -> dict[str, set[str]]:
    """Modules imported by every module of a package."""
    out = {}
    for path in Path(package.__file__).parent.glob("*.py"):
        names = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
        out[path.name] = names
    assert len(out) > 20
    return out


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [(discrepancy.team.causes, "mocobot_sim"), (mocobot_sim.effects, "discrepancy")],
    ids=["causes", "effects"],
)
def test_what_hides_and_what_finds_share_no_code(package, forbidden):
    for module, names in imports(package).items():
        assert not [name for name in names if name.split(".")[0] == forbidden], module
