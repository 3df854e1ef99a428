"""Hold what a verdict says of something unlisted against what was hidden: place, signal, formula."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.campaign.effects import one_axis
from sealed.law_truth import true_series

Item = Mapping[str, Any]
LIKE = 0.15
"""Largest difference of two curves over their size with which one is as good as the other."""


@dataclass(frozen=True)
class LawScore:
    """How well an unlisted effect was told.

    Attributes:
        which: of the verdict's unlisted ones, from 0, those that are located: a vector has one for each axis.
        place, variable, formula: whether these are right; ``formula`` also of a curve that is like it.
        size: error of the law's size, as a share; None without a law at the right place.
    """

    which: tuple[int, ...] = ()
    place: bool = False
    variable: bool = False
    formula: bool = False
    size: float | None = None

    @property
    def located(self) -> bool:
        """Whether place and signal are right."""
        return bool(self.which)


def score_laws(result: Item, trials: Sequence[Path]) -> list[LawScore]:
    """For every unlisted effect of a result what comes nearest to it of that which is told as unlisted."""
    told = [cause for cause in result["verdict"]["causes"] if cause["cause"] == "unlisted"]
    recordings = [read_recording(path) for path in trials] if told else []
    out: list[LawScore] = []
    for effect in result["truth"]["effects"]:
        if not effect.get("law"):
            continue
        taken = {k for one in out for k in one.which}
        each = [
            _score(k, cause, effect, result["truth"], recordings)
            for k, cause in enumerate(told) if k not in taken
        ]  # fmt: skip
        best = max(each, key=lambda one: (one.place, one.variable, one.formula), default=LawScore())
        out.append(replace(best, which=tuple(k for one in each for k in one.which)))
    return out


def _score(which: int, cause: Item, effect: Item, truth: Item, recordings: Sequence[Recording]) -> LawScore:
    place = _place(cause, effect, truth)
    variable, law = place and _variable(cause, effect), cause["law"]
    here = (which,) if variable else ()
    if not (place and law):
        return LawScore(here, place, variable)
    share, size = _alike(law, effect, recordings)
    named = law["function"] in FORMULAS.get(effect["cause"], ()) and _inside(law["numbers"], effect)
    return LawScore(here, place, variable, named or share < LIKE, size)


PLACES: dict[str, tuple[str, ...]] = {
    "tau reading": ("reading of the torque sensor of driven joint {joint} of robot {robot}",),
    "phi reading": ("reading of the angle of driven joint {joint} of robot {robot}",),
    "theta reading": ("reading of the angle of gimbal axis {joint} of robot {robot}",),
    "torque in driven joint": (  # the rows are the same
        "torque in driven joint {joint} of robot {robot}",
        "reading of the torque sensor of driven joint {joint} of robot {robot}",
    ),
    "torque in gimbal axis": ("torque in gimbal axis {joint} of robot {robot}",),
    "force on the payload, in the world": ("force and moment on the payload",),
    "moment on the payload": ("angular momentum inside the payload", "force and moment on the payload"),
    "force and moment on the payload": (
        "first moment of the payload's mass", "force and moment on the payload"
    ),
    "displacement of the base, down": (
        "displacement of base of robot {robot}", "displacement of grasp of robot {robot}"
    ),
}  # fmt: skip
"""Words of a verdict's place, by what the truth calls it."""
FORMULAS: dict[str, tuple[str, ...]] = {
    "cross_talk": ("linear",), "warming_scale": ("warming",), "warming_zero": ("warming",),
    "saturation": ("above", "beyond"), "quadratic_reading": ("square",), "angle_in_torque": ("sine",),
    "torque_hum": ("hum",), "eccentric_phi": ("sine",), "eccentric_theta": ("sine",),
    "cyclic_phi": ("sine",), "encoder_backlash": ("play",), "soft_encoder_mount": ("linear",),
    "slipping_zero": ("linear",), "cogging": ("sine",), "cubic_spring": ("cube",), "cable_spring": ("linear",),
    "door_closer": ("above",), "growing_push": ("linear",), "shaker": ("hum",), "gyroscope": ("constant",),
    "shifting_load": ("second_order",), "sinking_base": ("warming",),
    "scratched_disc": (), "soft_saturation": (), "loose_bridge": (), "fine_interpolation": (), "slack_hose": (),
}  # fmt: skip
"""Functions of the dictionary that are the hidden formula."""
PERIODS: dict[str, float] = {"eccentric_phi": 1.0, "eccentric_theta": 1.0, "cyclic_phi": 16.0}
VARIABLES: dict[str, tuple[set[str], ...]] = {
    "warming_scale": ({"time", "tau"},), "warming_zero": ({"time"},), "saturation": ({"tau"},),
    "quadratic_reading": ({"tau"},), "angle_in_torque": ({"phi"},),
    "torque_hum": ({"time"},), "eccentric_phi": ({"phi"},), "eccentric_theta": ({"theta"},), "cyclic_phi": ({"phi"},),
    "encoder_backlash": ({"phi"},), "soft_encoder_mount": ({"tau"},), "slipping_zero": ({"time"},),
    "cogging": ({"phi"},), "cubic_spring": ({"theta"},), "cable_spring": ({"theta"},), "door_closer": ({"phi_rate"},),
    "growing_push": ({"time"},), "shaker": ({"time"},), "gyroscope": ({"time"},), "sinking_base": ({"time"},),
    "scratched_disc": ({"phi"},), "soft_saturation": ({"tau"},), "loose_bridge": ({"tau"},),
    "fine_interpolation": ({"theta"},), "slack_hose": ({"theta"},),
}  # fmt: skip
"""Signals of the hidden formula, of its own joint."""


def _inside(numbers: Item, effect: Item) -> bool:
    """Whether the periods, frequency or time inside a function are right, too: within a tenth."""
    p = effect["parameters"]
    true = {
        "times": PERIODS.get(effect["cause"], p.get("times")),
        "frequency_hz": p.get("frequency_hz"),
        "time_s": p.get("time_s"),
    }
    near = {
        "times": 0.1,
        "frequency_hz": 0.25 if effect["cause"] == "shifting_load" else 0.01,
        "time_s": 0.25,
    }
    return all(
        true[name] is None or abs(numbers[name] / true[name] - 1.0) < near[name]
        for name in true
        if name in numbers
    )


def _place(cause: Item, effect: Item, truth: Item) -> bool:
    here, words = effect["law"]["place"], PLACES.get(effect["law"]["of"], ())
    places = [here]
    if effect["law"]["of"] == "torque in gimbal axis":  # parallel axes cannot be told apart
        every = ({"robot": i + 1, "joint": j} for i in range(len(truth["gimbal_axes_1"])) for j in (1, 2, 3))
        places = [other for other in every if one_axis(truth["gimbal_axes_1"], other, here)]
    names = [word.format(robot=one.get("robot"), joint=one.get("joint")) for word in words for one in places]
    return any(cause["place"].startswith(name) for name in names)


def _variable(cause: Item, effect: Item) -> bool:
    """Whether it is a function of the signals of the truth; those of a parallel axis are the same."""
    law = cause["law"] or {}
    found = {name for name in (law.get("of") or signal_of(cause), law.get("times")) if name}
    joint = re.search(r"(\d+) of robot (\d+)", cause["place"])
    own = {name.removesuffix(f"_{joint[2]}_{joint[1]}") if joint else name for name in found}
    if effect["cause"] == "cross_talk":
        return found == {f"tau_{effect['law']['place']['robot']}_{int(effect['parameters']['neighbour'])}"}
    if effect["cause"] == "shifting_load":
        return all(name.startswith(("payload_felt", "payload_up", "payload_acceleration")) for name in found)
    return own in VARIABLES.get(effect["cause"], (own,))  # of an event any


def signal_of(cause: Item) -> str:
    """Of what something located without a formula is a function, as its kind says: ``... by its SIGNAL``."""
    return cause["kind"].partition(" by its ")[2]


def _alike(law: Item, effect: Item, recordings: Sequence[Recording]) -> tuple[float, float | None]:
    """How far a stated law is from the hidden one as a function of time, over the size of that, and its size's error.

    Constants do not count: zeros are there for them.
    """
    true = true_series(effect, recordings)
    if true is None or not law.get("traces"):
        return math.inf, None
    pairs = [
        (np.atleast_2d(trace["law"]), _at(trace["time_s"], series, recording))
        for trace, series, recording in zip(law["traces"], true, recordings, strict=True)
    ]
    found, wanted = (np.concatenate([pair[k] for pair in pairs], axis=1) for k in (0, 1))
    if effect["law"]["of"] == "torque in driven joint" and law["place"] == "tau reading":
        wanted = -wanted
    if len(wanted) > 1:  # a law is of one axis
        wanted = wanted[["xyz".index(law["targets"][0][-1])]]
    if not wanted.any():
        return math.inf, None
    if np.ptp(wanted) > 1e-9 * np.abs(wanted).max():
        found, wanted = (x - x.mean(axis=1, keepdims=True) for x in (found, wanted))
    slope = float(np.sum(found * wanted) / np.sum(wanted**2))
    if effect["law"]["of"] == "torque in gimbal axis":  # a parallel axis may turn the other way
        found, slope = math.copysign(1.0, slope) * found, abs(slope)
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted)), abs(slope - 1.0)


def _at(time_s: Sequence[float], series: np.ndarray, recording: Recording) -> np.ndarray:
    """Rows of a series at other instants, shape (c, n)."""
    clock = recording.time - recording.time[0]
    return np.stack([np.interp(time_s, clock, row) for row in series])
