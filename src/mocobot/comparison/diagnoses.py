"""What two diagnoses say: the causes that both name, those of one alone, and whether the other could have seen them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.result.read import VERDICTS, name_of
from estimator.arrays import Array
from mocobot.comparison.difference import Group

Cause = Mapping[str, Any]
Values = Mapping[str, Any]
"""A diagnosis' JSON."""


def groups_of(a: Values, b: Values) -> list[Group]:
    """Parameters of the causes that both name at the same place; those that were chosen, not fitted, are left out."""
    groups, others = [], {_place(place): place for one in b["causes"] for place in _places(one)}
    for cause in (place for one in a["causes"] for place in _places(one)):
        other = others.get(_place(cause))
        if other is None:
            continue
        one, two = cause["parameters"], other["parameters"]
        names = [n for n in one if n in two and one[n]["se"] is not None and two[n]["se"] is not None]
        for name in names:
            groups.append(
                Group.of(f"{name_of(cause)}, {name}", "", ("",), _value(one[name]), _value(two[name]))
            )
    return groups


def changes_of(a: Values, b: Values) -> list[str]:
    """Verdicts that differ, and causes that one of them names alone, one sentence each."""
    out = []
    if a["verdict"] != b["verdict"]:
        before, after = (VERDICTS[one["verdict"]].lower() for one in (a, b))
        out.append(f"The verdict was {before} in A and is {after} in B.")
    for name, here, other_name, there in (("A", a, "B", b), ("B", b, "A", a)):
        named = {_place(place) for cause in there["causes"] for place in _places(cause)}
        for cause in here["causes"]:
            places = _places(cause)
            alone = [place for place in places if _place(place) not in named]
            # Of a kind that is nowhere else one sentence is enough.
            for one in [cause] if len(alone) == len(places) else alone:
                numbers = ", ".join([name_of(one), *_numbers(one)])
                out.append(f"Named in {name} alone: {numbers}; {other_name} {_could(one, there)}.")
    return out


def notes_of(a: Values, b: Values) -> list[str]:
    """What a reader must know of both."""
    left = [(name, one["residual"]["chi2_per_n"]) for name, one in (("A", a), ("B", b))]
    notes = [f"Misfit left (chi2/n): {', '.join(f'{value:.3g} in {name}' for name, value in left)}."]
    if a["causes"] or b["causes"]:
        notes.append(
            "Errors of one cause's parameters are correlated among each other, which their files do not say."
        )
    return notes


def _places(cause: Cause) -> list[Cause]:
    """A cause at each of its places; a kind has several."""
    members = cause.get("members", ())
    return [{**cause, **member, "members": ()} for member in members] if len(members) > 1 else [cause]


def _place(cause: Cause) -> tuple[str, int | None, int | None, str]:
    return cause["cause"], cause["robot"], cause["joint"], cause["place"]


def _value(parameter: Mapping[str, float]) -> tuple[Array, Array]:
    return np.array([parameter["value"]]), np.array([[parameter["se"] ** 2]])


def _numbers(cause: Cause) -> list[str]:
    return [
        f"{name} {one['value']:.3g}" + ("" if one["se"] is None else f" +- {one['se']:.2g}")
        for name, one in cause["parameters"].items()
    ]


def _could(cause: Cause, other: Values) -> str:
    """Whether the other recordings would have shown it."""
    limits: Sequence[Values] = [
        entry
        for entry in other["detection_limits"]
        if _place({"place": cause["place"]} | dict(entry)) == _place(cause)
    ]
    sizes = {
        name: size
        for entry in limits
        for name, size in entry["parameters"].items()
        if size is not None and name in cause["parameters"]
    }
    if not sizes:
        return "does not say whether it could have seen that"
    seen = any(abs(cause["parameters"][name]["value"]) >= size for name, size in sizes.items())
    listed = ", ".join(f"{name} {size:.2g}" for name, size in sizes.items())
    return (
        f"would have noticed {listed}, so it was not there"
        if seen
        else f"would only have noticed {listed}, so it may be there as well"
    )
