"""Effects as one word of a command line, and what such a word may say."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

from estimator.errors import InputError
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.effects.base import JOINTS, PLACE, WHOLE, Effect
from mocobot_sim.effects.catalogue import EFFECTS, make_effect

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
"""Units as they end the names of parameters, and as people write them."""
EXAMPLE = "joint_friction:robot=2,joint=1,coulomb=0.05"


@dataclass(frozen=True)
class Allowed:
    """One number of an effect.

    Attributes:
        name: of the field.
        short: the same without its unit, which will do.
        unit: of the value; empty for whole numbers and ratios.
        range: what it may be.
        default: where it may be left out; None where it must be given.
    """

    name: str
    short: str
    unit: str
    range: str
    default: float | str | None


def allowed(kind: type[Effect]) -> tuple[Allowed, ...]:
    """The numbers of an effect, its place first."""
    return tuple(
        Allowed(
            name=entry.name,
            short=(parted := _without_unit(entry.name))[0],
            unit=parted[1],
            range=_range(kind, entry.name),
            default=entry.default if isinstance(entry.default, int | float | str) else None,
        )
        for entry in fields(kind)
    )


def paragraphs(kind: type[Effect]) -> list[str]:
    """What an effect is and how it acts: its own documentation, the first paragraph in a nutshell."""
    return [" ".join(part.replace("``", "").split()) for part in (kind.__doc__ or "").split("\n\n")]


def parse_effect(text: str) -> Effect:
    """An effect of its name and numbers: ``joint_friction:robot=2,joint=1,coulomb=0.05``.

    Parameters may be named with their unit or without; values are in it.

    Raises:
        InputError: no such effect, or a number that is unknown, missing, no number, or out of its range.
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
    return _made(cause, values)


def _made(cause: str, values: Mapping[str, float | str]) -> Effect:
    place = {name: int(values[name]) for name in PLACE if name in values}
    return make_effect(cause, {name: v for name, v in values.items() if name not in PLACE}, **place)


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
    """Name and unit of a parameter; the longest unit that ends the name is meant."""
    for suffix in sorted(UNITS, key=len, reverse=True):
        if name.endswith(f"_{suffix}"):
            return name.removesuffix(f"_{suffix}"), UNITS[suffix]
    return name, ""
