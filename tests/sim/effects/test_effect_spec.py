"""Effects as words of a command line: what they make, and what is said about every number."""

from __future__ import annotations

from dataclasses import fields

import pytest

from effect_cases import SIZES
from estimator.errors import InputError
from mocobot_sim.effects.catalogue import EFFECTS, allowed, make_effect, paragraphs, parse_effect

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
            known = {"robot", "joint", "trial", "last_trial"} | RATIOS | set(kind.texts)
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
