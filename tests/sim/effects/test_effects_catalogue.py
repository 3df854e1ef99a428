"""The catalogue of effects: names, places, strict input, words of a command line, and nothing at zero size."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import fields

import numpy as np
import pytest

from effect_cases import SIZES, example, one_robot, team_with
from estimator.errors import InputError
from estimator.recording.model import Recording
from mocobot_sim.effects import EFFECTS, apply_effects, effect_from_dict, effect_to_dict, make_effect
from mocobot_sim.effects.catalogue import allowed, paragraphs, parse_effect
from mocobot_sim.extended.extended import load_extended, write_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted
from mocobot_sim.trial.trajectories import Trajectory, random_vias
from mocobot_sim.trial.trial import run_trial

EACH = pytest.mark.parametrize("cause", list(EFFECTS))


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> tuple[Trajectory, Recording]:
    """A motion, and what ideal sensors make of it without any effect."""
    scene = one_robot(tmp_path_factory.mktemp("clean"))
    trajectory = random_vias(scene.wrist_home_b, np.random.default_rng(0), 1, box_m=(0.03, 0.03, 0.03))
    return trajectory, predicted(run_trial(scene, trajectory))


def test_every_cause_is_named_as_it_is_listed():
    assert set(EFFECTS) == set(SIZES)
    for cause, kind in EFFECTS.items():
        assert kind.cause == cause
        assert kind.__doc__


@EACH
def test_plain_data_there_and_back(cause):
    effect = example(cause)
    values = json.loads(json.dumps(effect_to_dict(effect)))
    assert values["cause"] == cause
    assert values["parameters"] == SIZES[cause]
    assert effect_from_dict(values) == effect
    with pytest.raises(dataclasses.FrozenInstanceError):
        effect.robot = 2


@EACH
def test_nothing_at_zero_size(cause, clean, tmp_path):
    """A trial with motion is the same as without the effect, through ideal sensors."""
    trajectory, expected = clean
    with_zero = predicted(run_trial(one_robot(tmp_path, example(cause, zero=True)), trajectory))
    for channel in ("phi", "theta", "tau"):
        difference = np.abs(getattr(with_zero, channel) - getattr(expected, channel)).max()
        assert difference < (1e-6 if cause == "base_creep" else 1e-9), channel


@EACH
def test_something_at_a_plausible_size(cause, clean, tmp_path):
    trajectory, expected = clean
    rows = slice(100, None)
    changes = {"push": {"force_x_N": 0.3, "force_z_N": 0.1}, "base_creep": {"x_mps": 1e-4}}.get(cause, {})
    hidden = predicted(run_trial(one_robot(tmp_path, example(cause, **changes)), trajectory))
    seen = max(
        np.abs(getattr(hidden, c)[rows] - getattr(expected, c)[rows]).max() for c in ("phi", "theta", "tau")
    )
    assert seen > 1e-5


@pytest.mark.parametrize("robot", [1, 4])
def test_every_cause_at_once_in_a_team_of_five(teams, robot, tmp_path):
    """Effects combine, on one robot, and nothing opens that should not."""
    from payload_mjcf import FIVE

    changes = {
        "tether": {"anchor_z_m": 0.4},
        "slosh": {"point_x_m": 0.4, "point_y_m": 0.5, "point_z_m": 0.0},
        "base_tilt": {"roll_rad": 2e-3, "pitch_rad": -1e-3},
    }
    effects = [example(cause, robot=robot, **changes.get(cause, {})) for cause in EFFECTS]
    scene = team_with(FIVE.write(tmp_path), *effects)
    assert scene.effects == tuple(effects)
    log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(0), 1, box_m=(0.03,) * 3))
    assert log.rod_error_m < 0.02e-3
    assert np.isfinite(predicted(log).tau).all()


def test_effects_add_to_units_as_built(team_a):
    units = [dataclasses.replace(unit, phi_zero_rad=np.array([0.01, 0.02, 0.03])) for unit in team_a.units]
    scene = apply_effects(build_team("a", units), [example("phi_zero", 2, 3), example("sea_scale", 2, 1)])
    np.testing.assert_allclose(scene.units[1].phi_zero_rad, [0.01, 0.02, 0.031], rtol=1e-15)
    np.testing.assert_array_equal(scene.units[0].phi_zero_rad, [0.01, 0.02, 0.03])
    model = scene.compile()
    assert model.joint("omnid2/spring1").stiffness[0] == pytest.approx(102.0, rel=1e-15)
    assert model.joint("omnid2/spring2").stiffness[0] == 100.0


def test_scale_and_hardening_of_one_spring_in_either_order():
    pair = [example("sea_scale"), example("sea_hardening")]
    for effects in (pair, pair[::-1]):
        joint = team_with("a", *effects).compile().joint("omnid1/spring2")
        assert joint.stiffness[0] == pytest.approx(102.0)
        np.testing.assert_array_equal(np.ravel(joint.stiffnesspoly), [0.0, 200.0])


BAD = {
    "cause": (("rust", {}), r"cause 'rust' does not exist; the causes are phi_zero, theta_zero, "),
    "no robot": (("phi_zero", {"zero_rad": 0.1}, None, 1), "phi_zero: robot is missing; the places are robot, joint"),
    "no joint": (("phi_zero", {"zero_rad": 0.1}, 1), "phi_zero: joint is missing"),
    "joint of a base": (
        ("base_creep", {"x_mps": 0.0, "y_mps": 0.0}, 1, 1),
        "base_creep: joint does not belong here; the places are robot",
    ),
    "robot of the payload": (("drag", {"coefficient_Ns_per_m": 1.0}, 1), "drag: robot does not belong here"),
    "robot 0": (("phi_zero", {"zero_rad": 0.1}, 0, 1), "robot is 0; it must be a whole number of at least 1"),
    "joint 4": (("phi_zero", {"zero_rad": 0.1}, 1, 4), "joint is 4; it must be 1, 2 or 3"),
    "bool": (("phi_zero", {"zero_rad": 0.1}, True, 1), "robot is True"),
    "unknown": (("phi_zero", {"zero_deg": 1.0}, 1, 1), "unknown parameter 'zero_deg'; the parameters are zero_rad"),
    "missing": (("phi_zero", {}, 1, 1), "missing parameter 'zero_rad'"),
    "nan": (("phi_zero", {"zero_rad": float("nan")}, 1, 1), "zero_rad is nan; it must be a finite number"),
    "text": (("phi_zero", {"zero_rad": "1"}, 1, 1), "zero_rad is '1'"),
    "huge": (("phi_zero", {"zero_rad": 10**400}, 1, 1), "zero_rad is 1000"),
    "negative": (("grasp_flex", {"compliance_m_per_N": -1e-6}, 1), "must be a finite number of at least 0 and at most"),
    "scale": (("sea_scale", {"scale": -1.0}, 1, 1), "scale is -1.0; it must be a finite number of at least -0.9"),
    "trial": (("push", SIZES["push"] | {"trial": 0}), "trial is 0; it must be a whole number of at least 1"),
    "half a trial": (("push", SIZES["push"] | {"trial": 1.5}), "trial is 1.5"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_one_sentence(case):
    arguments, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence) as caught:
        make_effect(*arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (7, "effect is 7; it must be an object"),
        ({"cause": "drag"}, "missing key 'parameters'"),
        ({"cause": "drag", "parameters": {}, "place": 1}, "unknown key 'place'"),
        ({"cause": 1, "parameters": {}}, "cause must be text"),
    ],
)
def test_bad_plain_data_is_refused(values, sentence):
    with pytest.raises(InputError, match=sentence):
        effect_from_dict(values)


def test_places_that_a_scene_does_not_have_are_refused():
    with pytest.raises(InputError, match=r"phi_zero: robot is 4; the team has robots 1 \.\. 3"):
        team_with("a", example("phi_zero", robot=4))
    with pytest.raises(InputError, match="grasp_flex is given twice for robot 2; each place takes it once"):
        team_with("a", example("grasp_flex", 2), example("grasp_flex", 2))
    team_with("a", example("push"), example("push"), example("grasp_flex", 1), example("grasp_flex", 2))


def test_a_scene_from_a_folder_takes_no_more_effects(tmp_path):
    write_extended(build_team("a"), [], tmp_path / "model", {})
    with pytest.raises(InputError, match="a scene read from an extended model takes no further effects"):
        apply_effects(load_extended(tmp_path / "model"), [example("drag")])


def test_still_robots_with_every_mechanical_effect_stay_still(tmp_path):
    """They start at rest: what moves in the first second is less than the slack of a loose grasp."""
    for cause in (
        "base_tilt",
        "base_compliance",
        "grasp_flex",
        "tether",
        "slosh",
        "link_length",
        "sea_hardening",
    ):
        scene = team_with("a", example(cause, robot=2))
        log = run_trial(scene, Trajectory("static", np.tile(scene.wrist_home_b, (100, 1, 1))))
        # The bases' and links' own errors make the controller pull the wrists to where it believes home is.
        allowed = 2e-5 if cause in ("base_compliance", "grasp_flex", "tether", "slosh") else 5e-3
        assert np.abs(log.phi - log.phi[0]).max() < allowed, cause


RATIOS = {"scale", "damping_ratio", "second_share", "amplitude", "number", "second"}
"""Parameters without a unit; of a law they have that of what it acts on."""


@pytest.mark.parametrize("cause", EFFECTS)
@pytest.mark.parametrize("short", [True, False])
def test_every_effect_can_be_written(cause: str, short: bool) -> None:
    """With names that have their units and without them it is the effect that its name and numbers make."""
    numbers = allowed(EFFECTS[cause])
    place = {each.name: 2 for each in numbers if each.name in ("robot", "joint")}
    made = make_effect(cause, SIZES[cause], **place)
    values = {each: getattr(made, each.name) for each in numbers}
    words = [f"{each.short if short else each.name}={value}" for each, value in values.items()]
    assert parse_effect(f"{cause}:{','.join(words)}") == made


@pytest.mark.parametrize("cause", EFFECTS)
def test_what_is_listed_is_what_the_class_takes(cause: str) -> None:
    kind = EFFECTS[cause]
    numbers = allowed(kind)
    assert [each.name for each in numbers] == [entry.name for entry in fields(kind)]
    assert len({each.short for each in numbers}) == len(numbers), "a short name is not unique"
    assert paragraphs(kind)[0].endswith(".")
    for each in numbers:
        if each.unit:
            assert each.name.startswith(f"{each.short}_")
        else:
            known = {"robot", "joint", "trial", "last_trial", "draw"} | RATIOS | set(kind.texts)
            assert each.name in known, "a unit that nobody knows"
    words = ("0, 1, ...", "1, 2, ...", "1 to 3", "any number", "a name")
    assert {n.name: n.range for n in numbers if n.range not in words} == {
        name: f"{low:g} to {high:g}" for name, (low, high) in kind.ranges.items()
    }


def test_what_is_left_out_is_zero() -> None:
    assert parse_effect("joint_friction:robot=2,joint=1,coulomb=0.05") == make_effect(
        "joint_friction", {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.0}, robot=2, joint=1
    )


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("", "effect '' does not exist; the effects are phi_zero"),
        ("sea_bais:robot=1", "effect 'sea_bais' does not exist; did you mean 'sea_bias'?"),
        ("sea_bias", "robot and joint and bias must be given; write it as joint_friction:"),
        ("sea_bias:", "there is no ''; sea_bias takes robot, joint, bias"),
        ("sea_bias:robot=1,joint=1,bias", "bias is ''; it must be any number N m"),
        ("sea_bias:robot=1,joint=1,bias=nan", "bias is 'nan'; it must be any number N m"),
        ("sea_bias:robot=1,joint=1,bias=1,bias_Nm=2", "bias_Nm is given twice"),
        ("sea_bias:robot=1.5,joint=1,bias=1", "robot is '1.5'; it must be 1, 2, ..."),
        ("sea_bias:robot=1,joint=4,bias=1", "sea_bias: joint is 4; it must be 1, 2 or 3"),
        ("sea_scale:robot=1,joint=1,scale=-1", "scale is -1.0; it must be a finite number of at least -0.9"),
        ("base_tilt:robot=1", "at least one parameter must be given; write it as"),
        ("push:trial=x,start=1,duration=1", "trial is 'x'; it must be 1, 2, ..."),
    ],
)
def test_wrong_words_are_answered_with_what_is_allowed(word: str, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_effect(word)
    assert sentence in str(caught.value)
