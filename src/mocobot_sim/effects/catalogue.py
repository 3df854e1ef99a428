"""The catalogue of all effects: make them by name, convert them to plain data, parse them from a command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from estimator.errors import InputError
from estimator.strict import Fields
from mocobot_sim.effect_names import NAMES, check_effect_name
from mocobot_sim.effects import friction_and_springs, geometry, law, payload, readings
from mocobot_sim.effects.base import JOINTS, PLACE, WHOLE, Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

SUBJECTS = (readings, friction_and_springs, geometry, payload, law)
_KINDS: dict[str, type[Effect]] = {
    kind.cause: kind
    for subject in SUBJECTS
    for kind in vars(subject).values()
    if isinstance(kind, type) and issubclass(kind, Effect) and kind is not Effect
}
EFFECTS: dict[str, type[Effect]] = {name: _KINDS[name] for name in NAMES}
"""Class of each effect by the name of its cause: ``sea_bias`` is ``SeaBias``."""


def make_effect(
    cause: str, parameters: Mapping[str, Any], robot: int | None = None, joint: int | None = None
) -> Effect:
    """Make an effect from the name of its cause, its parameters and its place.

    Args:
        cause: a key of ``EFFECTS``.
        parameters: values by name; suffixes give the units.
        robot, joint: place, counted from 1 (legs 1, 2, 3; gimbal axes z, y, x); None where the cause has no such place.

    Raises:
        InputError: the cause is unknown, or a parameter or place is unknown, missing or out of range.
    """
    if cause not in EFFECTS:
        raise InputError(f"cause {cause!r} does not exist; the causes are {', '.join(EFFECTS)}")
    kind = EFFECTS[cause]
    place = {name: value for name, value in zip(PLACE, (robot, joint), strict=True) if value is not None}
    for name in PLACE:
        if (name in place) != (name in kind.place_names()):
            problem = "is missing" if name not in place else "does not belong here"
            rule = ", ".join(kind.place_names()) or "none"
            raise InputError(f"{cause}: {name} {problem}; the places are {rule}")
    names = kind.parameter_names()
    required = [entry.name for entry in fields(kind) if entry.name in names and _default(entry) is None]
    unknown = [name for name in parameters if name not in names]
    missing = [name for name in required if name not in parameters]
    if unknown or missing:
        problem = f"unknown parameter {unknown[0]!r}" if unknown else f"missing parameter {missing[0]!r}"
        raise InputError(f"{cause}: {problem}; the parameters are {', '.join(names)}")
    values = dict(parameters)
    for name in WHOLE:
        if isinstance(values.get(name), float) and float(values[name]).is_integer():
            values[name] = int(values[name])
    return kind(**place, **values)


def _default(entry: Any) -> float | str | None:
    """Default value of a field of an effect; None if the field has none."""
    return entry.default if isinstance(entry.default, int | float | str) else None


def effect_to_dict(effect: Effect) -> dict[str, Any]:
    """Convert an effect to JSON values: ``cause``, ``robot`` and ``joint`` where it has them, ``parameters``."""
    parameters = {name: getattr(effect, name) for name in effect.parameter_names()}
    return {"cause": effect.cause, **_place(effect), "parameters": parameters}


def _place(effect: Effect) -> dict[str, int]:
    return {name: getattr(effect, name) for name in effect.place_names()}


def effect_from_dict(values: Mapping[str, Any]) -> Effect:
    """Make an effect from the output of ``effect_to_dict``.

    Raises:
        InputError: a key is unknown or missing, or a value is not allowed.
    """
    Fields(values, ("cause", "parameters"), "effect", PLACE)
    if not isinstance(values["cause"], str) or not isinstance(values["parameters"], Mapping):
        raise InputError("effect: cause must be text and parameters an object")
    return make_effect(values["cause"], values["parameters"], values.get("robot"), values.get("joint"))


def apply_effects(scene: TeamScene, effects: Sequence[Effect]) -> TeamScene:
    """Return a newly built scene with effects added; its PyMJCF tree is edited in place.

    Raises:
        InputError: a place does not exist, or has the same cause twice (only pushes and laws may repeat).
    """
    places = [(effect.cause, _place(effect)) for effect in scene.effects]
    for effect in effects:
        place = effect.cause, _place(effect)
        if place in places and not effect.repeats:
            where = " ".join(f"{name} {at}" for name, at in place[1].items())
            raise InputError(
                f"{effect.cause} is given twice{where and f' for {where}'}; each place takes it once"
            )
        places.append(place)
        scene = effect.apply(scene)
    # ``tuned`` compiles the model, so call it once for all effects.
    return replace(scene, effects=(*scene.effects, *effects)).tuned()


UNITS = {
    "Nm": "N m",
    "rad_per_N": "rad/N",
    "Nms_per_rad": "N m s/rad",
    "Nm_per_rad3": "N m/rad^3",
    "rad": "rad",
    "m": "m",
    "mps": "m/s",
    "m_per_N": "m/N",
    "N_per_m": "N/m",
    "Ns_per_m": "N s/m",
    "Ns2_per_m2": "N s^2/m^2",
    "Nms2_per_rad2": "N m s^2/rad^2",
    "N": "N",
    "kgps": "kg/s",
    "kg": "kg",
    "m2": "m^2",
    "s": "s",
}
"""Unit in readable form by the suffix of a parameter's name."""
EXAMPLE = "joint_friction:robot=2,joint=1,coulomb=0.05"


@dataclass(frozen=True)
class Allowed:
    """Description of one field of an effect."""

    name: str  # name of the field
    short: str  # name without its unit, also accepted on the command line
    unit: str  # unit of the value; empty for whole numbers and ratios
    range: str  # allowed values, in words
    default: float | str | None  # default value; None if the field is required


def allowed(kind: type[Effect]) -> tuple[Allowed, ...]:
    """Describe all fields of an effect, place first."""
    return tuple(
        Allowed(entry.name, *_without_unit(entry.name), _range(kind, entry.name), _default(entry))
        for entry in fields(kind)
    )


def paragraphs(kind: type[Effect]) -> list[str]:
    """Paragraphs of the documentation of an effect, each on one line; the first is a summary."""
    return [" ".join(part.replace("``", "").split()) for part in (kind.__doc__ or "").split("\n\n")]


def parse_effect(text: str) -> Effect:
    """Parse an effect from text such as ``joint_friction:robot=2,joint=1,coulomb=0.05``.

    Names of parameters may omit the unit; values are always in that unit.

    Raises:
        InputError: the effect is unknown, or a parameter is unknown, missing, not a number or out of range.
    """
    cause, colon, rest = text.partition(":")
    check_effect_name(cause)
    known = allowed(EFFECTS[cause])
    names = {short: each for each in known for short in (each.short, each.name)}
    values: dict[str, float | str] = {}
    for part in rest.split(",") if colon else ():
        name, _, word = part.partition("=")
        if name not in names:
            listed = ", ".join(each.short for each in known)
            raise InputError(f"effect {text!r}: there is no {name!r}; {cause} takes {listed}")
        number = names[name]
        if number.name in values:
            raise InputError(f"effect {text!r}: {name} is given twice")
        values[number.name] = word if number.name in EFFECTS[cause].texts else _value(text, number, word)
    missing = [each.short for each in known if each.default is None and each.name not in values]
    if missing or not set(values) - set(PLACE):
        rule = f"{' and '.join(missing)} must be given" if missing else "at least one parameter must be given"
        raise InputError(f"effect {text!r}: {rule}; write it as {EXAMPLE}, and see mocobot effects {cause}")
    place = {name: int(values.pop(name)) for name in PLACE if name in values}
    return make_effect(cause, values, **place)


def _value(text: str, number: Allowed, word: str) -> float:
    whole = number.name in WHOLE
    try:
        value = int(word) if whole else float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        rule = f"{number.range} {number.unit}".rstrip()
        raise InputError(f"effect {text!r}: {number.short} is {word!r}; it must be {rule}")
    return value


def _range(kind: type[Effect], name: str) -> str:
    if name == "joint":
        return f"1 to {JOINTS}"
    if name in WHOLE:
        return f"{WHOLE[name]}, {WHOLE[name] + 1}, ..."
    if name in kind.texts:
        return "a name"
    if name not in kind.ranges:
        return "any number"
    low, high = kind.ranges[name]
    return f"{low:g} to {high:g}"


def _without_unit(name: str) -> tuple[str, str]:
    """Split a parameter's name into stem and readable unit; the longest suffix in ``UNITS`` wins."""
    for suffix in sorted(UNITS, key=len, reverse=True):
        if name.endswith(f"_{suffix}"):
            return name.removesuffix(f"_{suffix}"), UNITS[suffix]
    return name, ""
