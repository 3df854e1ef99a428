"""Hold a law that a diagnosis states against the one that was hidden: place, signal, formula, size."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.campaign.ground import one_axis
from sealed.grounded import of_the_background
from sealed.law_truth import instants, true_series

Item = Mapping[str, Any]
LIKE = 0.15
"""Largest difference of two curves over their size with which one is as good as the other."""
CLOSE = 0.1
"""Largest error of an amplitude that counts as right."""


@dataclass(frozen=True)
class LawScore:
    """How well an unlisted effect was stated.

    Attributes:
        stated: whether any law was.
        place, variable, formula: whether these are right; ``formula`` also of a curve that is like it.
        amplitude: error of its size, as a share; None without a right place.
        held_out: share of the gain on trials left out over that in sample, or None.
        beside: other laws and causes that were named and are not there, or are there as something else.
        grounded: causes that were named and that the background drew.
    """

    stated: bool
    place: bool = False
    variable: bool = False
    formula: bool = False
    amplitude: float | None = None
    held_out: float | None = None
    beside: int = 0
    grounded: int = 0


def stated_series(diagnosis: Any) -> list[list[dict[str, Any]]]:
    """Every stated law as a function of time: per law and trial ``time_s`` and ``values`` (one row a component)."""
    rig, out = diagnosis.rig, []
    for found in diagnosis.diagnosis.causes:
        if found.candidate.cause != "law":
            continue
        law = found.candidate
        table = found.values.reshape(-1, len(law.at.axes))
        trials = []
        for t, recording in enumerate(rig.recordings):
            at = instants(recording)
            values = rig.bench.values(t, law)[at] @ table
            trials.append({"time_s": recording.time[at].tolist(), "values": values.T.tolist()})
        out.append(trials)
    return out


def score_laws(result: Item, trials: Sequence[Path]) -> list[LawScore]:
    """For every unlisted effect of a result the law that comes nearest to it."""
    effects, causes = result["truth"]["effects"], result["verdict"]["causes"]
    laws = [cause for cause in causes if cause["cause"] == "law"]
    listed = [cause for cause in causes if cause["cause"] != "law"]
    grounded = sum(of_the_background(cause, result["truth"]) for cause in listed)
    beside = len(listed) - grounded + max(len(laws) - len(effects), 0)
    if not laws:
        return [LawScore(stated=False, beside=beside, grounded=grounded) for _ in effects]
    recordings = [read_recording(path) for path in trials]
    out = []
    for effect in effects:
        each = [
            _score(law, series, effect, result["truth"], recordings)
            for law, series in zip(laws, result["verdict"]["law_series"], strict=True)
        ]
        best = max(each, key=lambda one: (one.place, one.variable, one.formula))
        out.append(replace(best, beside=beside, grounded=grounded))
    return out


def _score(
    law: Item, series: Sequence[Item], effect: Item, truth: Item, recordings: Sequence[Recording]
) -> LawScore:
    said, gain = law["law"], law["explained"]
    place = _place(law, effect, truth)
    held = None if gain["held_out"] is None or not gain["in_sample"] else gain["held_out"] / gain["in_sample"]
    share, size = _alike(said, series, effect, recordings) if place else (math.inf, None)
    named = said["function"] in FORMULAS[effect["cause"]] and _inside(said["numbers"], effect)
    return LawScore(
        stated=True,
        place=place,
        variable=place and _variable(law, effect),
        formula=place and (named or share < LIKE),
        amplitude=size,
        held_out=held,
    )


PLACES: dict[str, tuple[str, ...]] = {
    "tau reading": ("tau reading",),
    "phi reading": ("phi reading",),
    "theta reading": ("theta reading",),
    "torque in driven joint": ("driven torque", "tau reading"),  # the rows are the same
    "torque in gimbal axis": ("gimbal torque",),
    "force on the payload, in the world": ("force on payload",),
    "moment on the payload": ("payload spin",),
    "force and moment on the payload": ("payload centre", "force on payload"),
    "displacement of the base, down": ("base position", "grasp position"),
}
"""Names of the diagnosis for what the truth calls a place."""
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


def _place(law: Item, effect: Item, truth: Item) -> bool:
    if law["law"]["place"] not in PLACES[effect["law"]["of"]]:
        return False
    here = effect["law"]["place"]
    if law["law"]["place"] == "gimbal torque":
        return one_axis(truth["gimbal_axes_1"], law, here)
    return (law["robot"], law["joint"]) == (here.get("robot"), here.get("joint"))


def _variable(law: Item, effect: Item) -> bool:
    """Whether it is a function of the signals of the truth; those of a parallel axis are the same."""
    said, here = law["law"], effect["law"]["place"]
    found = {name for name in (said["of"], said["times"]) if name}
    at = f"{law['robot']}_{law['joint']}"
    own = {name.removesuffix(f"_{at}") if here.get("joint") else name for name in found}
    if effect["cause"] == "cross_talk":
        return found == {f"tau_{here['robot']}_{int(effect['parameters']['neighbour'])}"}
    if effect["cause"] == "shifting_load":
        return all(name.startswith(("payload_felt", "payload_up", "payload_acceleration")) for name in found)
    return own in VARIABLES[effect["cause"]]


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


def _alike(
    said: Item, series: Sequence[Item], effect: Item, recordings: Sequence[Recording]
) -> tuple[float, float | None]:
    """How far the stated law is from the hidden one as a function of time, over the size of that, and its size's error.

    Constants and, of an encoder, what is linear in its angle do not count: zeros and lengths are there for them.
    """
    true = true_series(effect, recordings)
    if true is None:
        return math.inf, None
    sign = -1.0 if effect["law"]["of"] == "torque in driven joint" and said["place"] == "tau reading" else 1.0
    found = np.concatenate([np.array(one["values"]) for one in series], axis=1)
    wanted = sign * np.concatenate(true, axis=1)
    if len(found) > len(wanted):  # a force beside its moment
        found = found[: len(wanted)]
    found, wanted = (x - x.mean(axis=1, keepdims=True) for x in (found, wanted))
    if np.linalg.norm(wanted) < 1e-9 * max(np.linalg.norm(x) for x in true):  # a constant, as of what spins
        found, wanted = (
            np.concatenate([np.array(x) for x in y], axis=1)
            for y in ([one["values"] for one in series], true)
        )
    slope = float(np.sum(found * wanted) / np.sum(wanted**2))
    if effect["law"]["of"] == "torque in gimbal axis":  # a parallel axis may turn the other way
        found, slope = math.copysign(1.0, slope) * found, abs(slope)
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted)), abs(slope - 1.0)
