"""Effects hidden by the simulator, found by a diagnosis that does not know what was hidden."""

import ast
from pathlib import Path

import numpy as np
import pytest
from discrepancy.rules import CLEAN_CHI2_PER_N

import discrepancy.team.causes
import mocobot_sim.effects
from discrepancy.team.causes import CAUSES
from hidden.draw import ground_of
from hidden.generator import generate
from hidden.limits import LIMITS, pendulum_limit_kg
from hidden.score import score
from hidden.sealed import Sealed
from hidden_quick import blind, generated, quick_set, tiny_set
from mocobot.campaign.draw import draw_effect
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
    assert [item["cause"] for item in verdict["found"]] == list(request_.causes)
    (one,), extras = score(verdict, truth)
    assert one.family
    assert one.member
    assert one.place
    assert one.error < 0.2
    assert not extras
    assert verdict["after"] < verdict["before"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["clean", "tolerance"])
def test_nothing_is_named_where_nothing_is_hidden(kind):
    verdict, truth = blind(quick_set(kind, 6, payload="b"))
    assert truth["effects"] == []
    assert (len(truth["background"]) > 100) == (kind == "tolerance")
    assert verdict["found"] == []
    assert verdict["after"] < CLEAN_CHI2_PER_N


@pytest.mark.slow
def test_without_the_true_cause_only_its_family_is_named():
    request = HIDDEN[1]
    verdict, truth = blind(request, excluded=request.causes, laws="never")
    family = CAUSES[truth["effects"][0]["cause"]].family
    assert "sea_bias" not in [item["cause"] for item in verdict["found"]]
    assert all(item["family"] == family for item in verdict["found"][:1])


@pytest.mark.slow
def test_without_the_true_cause_it_is_stated_as_a_law_at_its_place():
    request = HIDDEN[1]
    verdict, truth = blind(request, excluded=request.causes)
    (item,), (effect,) = verdict["found"], truth["effects"]
    assert (item["cause"], item["robot"], item["joint"]) == ("law", effect["robot"], effect["joint"])
    assert abs(item["parameters"]["amplitude"]) == pytest.approx(
        abs(effect["parameters"]["bias_Nm"]), rel=0.1
    )


def test_equal_requests_give_equal_bits():
    first, second = generated(tiny_set(3)), generate(tiny_set(3))
    assert first[1].open({"found": []}) == second[1].open({"found": []})
    assert all((a.tau == b.tau).all() for a, b in zip(first[0], second[0], strict=True))
    other = generated(tiny_set(4))
    assert other[1].open({"found": []}) != first[1].open({"found": []})


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


# The score itself: what it must not let pass.
TRUTH = {
    "effects": [{"cause": "sea_bias", "robot": 2, "joint": 1, "parameters": {"bias_Nm": 0.08}}],
    "gimbal_axes_1": [],
}


def found(cause="sea_bias", robot=2, joint=1, **parameters):
    parameters = parameters or {"bias_Nm": 0.06}
    return {"cause": cause, "robot": robot, "joint": joint, "parameters": parameters, "rivals": []}


@pytest.mark.parametrize(
    ("items", "right", "extras"),
    [
        ([found()], (True, True, True), []),
        ([found(joint=3)], (True, True, False), []),
        ([found("sea_scale", scale=0.1)], (True, False, False), []),
        ([found("drag", None, None, coefficient_Ns_per_m=1.0)], (False, False, False), []),
        ([], (False, False, False), []),
        ([found("drag", None, None, coefficient_Ns_per_m=1.0), found()], (True, True, True), ["drag"]),
    ],
    ids=["right", "wrong place", "wrong member", "wrong family", "missed", "one too many"],
)
def test_score(items, right, extras):
    (one,), besides = score({"found": items}, TRUTH)
    assert (one.family, one.member, one.place) == right
    assert besides == extras
    assert one.error == (pytest.approx(0.25) if one.place else None)


def test_score_in_standard_errors():
    item = found() | {"standard_errors": {"bias_Nm": 0.005, "other": 1.0}}
    assert score({"found": [item]}, TRUTH)[0][0].deviations == pytest.approx((-4.0,))
    unknown = found() | {"standard_errors": {"bias_Nm": float("nan")}}
    assert score({"found": [unknown]}, TRUTH)[0][0].deviations == ()
    misplaced = found(joint=3) | {"standard_errors": {"bias_Nm": 0.005}}
    assert score({"found": [misplaced]}, TRUTH)[0][0].deviations == ()


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
