"""Kinds of which all places are off: what the robots need is a calibration."""

from collections.abc import Mapping
from typing import Any

from discrepancy.causes.units import one_each, parameter
from discrepancy.engine.explanation import Scatter
from discrepancy.result.read import kind_of

REMEDY = '"mocobot calibrate" finds the robots as they are; diagnose again with what it writes.'


def scatter_to_dict(item: Scatter) -> dict[str, Any]:
    """One entry of ``scatter``; see ``discrepancy.result.json``."""
    tolerance = {p.name: float(p.tolerance) for p in item.candidate.parameters}
    values: dict[str, Any] = {
        "cause": item.candidate.cause,
        "kind": item.candidate.kind,
        "family": item.candidate.family,
        "factor": float(item.factor),
        "places": item.places,
        "spread": {name: item.factor * size for name, size in tolerance.items()},
        "tolerance": tolerance,
        "nats": float(item.nats),
    }
    return values | {"sentence": _sentence(values)}


def _sentence(entry: Mapping[str, Any]) -> str:
    kind = kind_of(entry)
    return (
        f"{kind[:1].upper()}{kind[1:]}: a spread of {sizes_of(entry, 'spread')} over {entry['places']} places "
        f"(tolerance {sizes_of(entry, 'tolerance')})."
    )


def sizes_of(entry: Mapping[str, Any], which: str) -> str:
    """``spread`` or ``tolerance`` of an entry in words; both in the unit that fits the spread."""
    shown = one_each((parameter(name)[1], size) for name, size in entry["spread"].items())
    said = []
    for name, size in entry[which].items():
        words, unit = parameter(name)
        unit, scale = shown[unit]
        number = f"{scale * size:.2g} {unit}".rstrip()
        said.append(number if len(entry[which]) == 1 else f"{words} {number}")
    return ", ".join(said)
