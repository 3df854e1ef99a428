"""All causes by name, and effects as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from estimator.errors import InputError
from estimator.strict import Fields
from mocobot_sim.effect_names import NAMES
from mocobot_sim.effects.base import PLACE, WHOLE, Effect
from mocobot_sim.scene.applied import Applied

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

EFFECTS: dict[str, type[Effect]] = {
    name: getattr(import_module(f"mocobot_sim.effects.{name}"), name.title().replace("_", ""))
    for name in NAMES
}
"""Every effect's class by the name of its cause; that in ``sea_bias.py`` is ``SeaBias``."""


def make_effect(
    cause: str, parameters: Mapping[str, Any], robot: int | None = None, joint: int | None = None
) -> Effect:
    """Make an effect from its name, parameters and place.

    Args:
        cause: a key of ``EFFECTS``.
        parameters: values by name, units in the names.
        robot: 1-based robot, for causes that have one.
        joint: 1-based joint (legs 1, 2, 3; gimbal z, y, x), for causes that have one.

    Raises:
        InputError: no such cause, a parameter or place that is unknown, missing or out of its range.
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
    _check_keys(cause, parameters, kind)
    values = dict(parameters)
    for name in WHOLE:
        if isinstance(values.get(name), float) and float(values[name]).is_integer():
            values[name] = int(values[name])
    return kind(**place, **values)


def _check_keys(cause: str, parameters: Mapping[str, Any], kind: type[Effect]) -> None:
    names = kind.parameter_names()
    required = [entry.name for entry in fields(kind) if entry.name in names and not _has_default(entry)]
    unknown = [name for name in parameters if name not in names]
    missing = [name for name in required if name not in parameters]
    if unknown or missing:
        problem = f"unknown parameter {unknown[0]!r}" if unknown else f"missing parameter {missing[0]!r}"
        raise InputError(f"{cause}: {problem}; the parameters are {', '.join(names)}")


def _has_default(entry: Any) -> bool:
    return isinstance(entry.default, int | float | str)


def effect_to_dict(effect: Applied) -> dict[str, Any]:
    """Plain JSON values: ``cause``, ``robot`` and ``joint`` where there are, ``parameters``."""
    parameters = {name: getattr(effect, name) for name in effect.parameter_names()}
    return {"cause": effect.cause, **_place(effect), "parameters": parameters}


def _place(effect: Applied) -> dict[str, int]:
    return {name: getattr(effect, name) for name in effect.place_names()}


def effect_from_dict(values: Mapping[str, Any]) -> Effect:
    """The reverse of ``effect_to_dict``.

    Raises:
        InputError: a key is unknown or missing, or its value is not allowed.
    """
    Fields(values, ("cause", "parameters"), "effect", PLACE)
    if not isinstance(values["cause"], str) or not isinstance(values["parameters"], Mapping):
        raise InputError("effect: cause must be text and parameters an object")
    return make_effect(values["cause"], values["parameters"], values.get("robot"), values.get("joint"))


def apply_effects(scene: TeamScene, effects: Sequence[Effect]) -> TeamScene:
    """Put effects into a freshly built scene (its PyMJCF tree is edited in place) and return it.

    Raises:
        InputError: a place does not exist, or has the same cause twice (pushes may repeat).
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
    # Once for all of them: it compiles the model.
    return replace(scene, effects=(*scene.effects, *effects)).tuned()
