"""What a verdict is worth: against what was hidden, what the background drew, and the laws as they are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.team.causes import CAUSES, default_tolerances
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.campaign.effects import one_axis
from mocobot.campaign.summary import Score, match
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import omnid_design
from scoring import SURE
from sealed.forces import SLACK_RAD
from sealed.form import BoucWen, Play
from sealed.readings import SCRATCH_RAD, SOFT_NM, YIELD_NM

Item = Mapping[str, Any]
LARGE = 4.0
"""Tolerances that a drawn size must exceed to be a fault of its own: a robot within four of them needs no repair."""
NEAR, NEAR_SE = 0.25, 3.0
"""Share or standard errors by which a named size may be off the drawn one."""


def of_the_background(item: Item, truth: Item) -> bool:
    """Whether a named cause is what the background drew there, larger than any tolerance, at its true size.

    At ten times the tolerances one place in three has more of a kind than four tolerances: whoever names it is right.
    """
    return any(_is(item, effect, truth) for effect in truth["background"] if effect["cause"] == item["cause"])


def _is(item: Item, effect: Item, truth: Item) -> bool:
    tolerances = default_tolerances()[effect["cause"]]
    known = {name: value for name, value in effect["parameters"].items() if name in tolerances}
    large = {name for name, value in known.items() if abs(value) > LARGE * tolerances[name]}
    if not large:
        return False
    answer = {"cause": effect["cause"], "robot": effect.get("robot"), "joint": effect.get("joint")}
    as_hidden = {**effect, "answer": {**answer, "known": {name: known[name] for name in large}}}
    (score,) = match([item], {**truth, "effects": [as_hidden]}, [1.0]).scores
    near = score.error is not None and score.error < NEAR
    within = bool(score.deviations) and float(np.max(np.abs(score.deviations))) < NEAR_SE
    return score.right and (near or within)


Series = list[np.ndarray]


def true_series(effect: Item, recordings: Sequence[Recording]) -> Series | None:
    """By trial one row a component, at all samples; None of an effect that is no function of what is recorded."""
    p, here = effect["parameters"], effect["law"]["place"]
    if effect["cause"] not in SHAPES:
        return None
    out = []
    for recording in recordings:
        values = SHAPES[effect["cause"]](_Seen(recording, here), p)
        out.append(np.atleast_2d(np.asarray(values, dtype=float)))
    return out


@dataclass(frozen=True)
class _Seen:
    """Signals of one trial at the place of an effect."""

    recording: Recording
    here: Item

    @property
    def t(self) -> np.ndarray:
        return self.recording.time - self.recording.time[0]

    @property
    def phi(self) -> np.ndarray:
        return self._own(self.recording.phi) - home_phi(omnid_design())

    @property
    def theta(self) -> np.ndarray:
        return self._own(self.recording.theta)

    @property
    def tau(self) -> np.ndarray:
        return self._own(self.recording.tau)

    def neighbour(self, joint: float) -> np.ndarray:
        return self.recording.tau[:, self.here["robot"] - 1, int(joint) - 1]

    def _own(self, x: np.ndarray) -> np.ndarray:
        return x[:, self.here["robot"] - 1, self.here["joint"] - 1]


def _vector(p: Item, stem: str) -> np.ndarray:
    return np.array([p[f"{stem}_{axis}_m"] for axis in "xyz"])[:, None]


def _behind(x: np.ndarray, half_width: float) -> np.ndarray:
    play = Play(half_width)
    return np.array([play.step(value) for value in x.tolist()]) - x


def _bent(x: np.ndarray, amplitude: float) -> np.ndarray:
    wen = BoucWen(amplitude, YIELD_NM, 0.5, 1.0)
    return np.array([wen.step(step, 1.0) for step in np.diff(x, prepend=x[0]).tolist()])


SHAPES: dict[str, Callable[[_Seen, Item], np.ndarray]] = {
    "cross_talk": lambda s, p: p["share"] * s.neighbour(p["neighbour"]),
    "warming_scale": lambda s, p: -p["scale"] * np.expm1(-s.t / p["time_s"]) * s.tau,
    "warming_zero": lambda s, p: -p["zero_Nm"] * np.expm1(-s.t / p["time_s"]),
    "saturation": lambda s, p: -p["lost_share"] * np.maximum(s.tau - p["knee_Nm"], 0.0),
    "quadratic_reading": lambda s, p: p["per_Nm"] * s.tau**2,
    "angle_in_torque": lambda s, p: p["amplitude_Nm"] * np.sin(p["times"] * s.phi + p["phase_rad"]),
    "torque_hum": lambda s, p: p["amplitude_Nm"] * np.sin(2.0 * np.pi * p["frequency_hz"] * s.t),
    "eccentric_phi": lambda s, p: p["amplitude_rad"] * np.sin(s.phi + p["phase_rad"]),
    "eccentric_theta": lambda s, p: p["amplitude_rad"] * np.sin(s.theta + p["phase_rad"]),
    "cyclic_phi": lambda s, p: p["amplitude_rad"] * np.sin(16.0 * s.phi + p["phase_rad"]),
    "encoder_backlash": lambda s, p: _behind(s.phi, p["half_width_rad"]),
    "soft_encoder_mount": lambda s, p: p["rad_per_Nm"] * s.tau,
    "slipping_zero": lambda s, p: p["rate_radps"] * s.t,
    "torque_ramp": lambda s, p: p["rate_Nmps"] * s.t,
    "dead_band": lambda s, p: -np.clip(s.tau - p["centre_Nm"], -p["half_width_Nm"], p["half_width_Nm"]),
    "cogging": lambda s, p: p["amplitude_Nm"] * np.sin(p["times"] * s.phi + p["phase_rad"]),
    "cubic_spring": lambda s, p: -p["cubic_Nm_per_rad3"] * s.theta**3,
    "cable_spring": lambda s, p: -p["stiffness_Nm_per_rad"] * (s.theta - p["rest_rad"]),
    "door_closer": lambda s, p: -p["damping_Nms_per_rad"] * np.maximum(np.gradient(s.phi, s.t), 0.0),
    "growing_push": lambda s, p: _vector(p, "along") * p["rate_Nps"] * s.t,
    "shaker": lambda s, p: (
        _vector(p, "along") * p["amplitude_N"] * np.sin(2.0 * np.pi * p["frequency_hz"] * s.t)
    ),
    "gyroscope": lambda s, p: _vector(p, "along") * p["spin_kgm2ps"] * np.ones(len(s.t)),
    "scratched_disc": lambda s, p: p["depth_rad"] * np.exp(-(((s.phi - p["at_rad"]) / SCRATCH_RAD) ** 2)),
    "soft_saturation": lambda s, p: -p["lost_share"] * (s.tau - SOFT_NM * np.tanh(s.tau / SOFT_NM)),
    "loose_bridge": lambda s, p: _bent(s.tau, p["amplitude_Nm"]),
    "fine_interpolation": lambda s, p: p["amplitude_rad"] * np.sin(64.0 * s.theta + p["phase_rad"]),
    "slack_hose": lambda s, p: (
        -p["square_Nm_per_rad2"] * np.copysign(np.maximum(np.abs(s.theta) - SLACK_RAD, 0.0) ** 2, s.theta)
    ),
    "sinking_base": lambda s, p: (
        np.array([[0.0], [0.0], [1.0]]) * p["depth_m"] * np.expm1(-s.t / p["time_s"])
    ),
}
"""What each does, from the signals at its place and its parameters."""


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


HELD = {
    "dropouts_phi": "driven joint {joint} of robot {robot}",
    "dropouts_theta": "gimbal axis {joint} of robot {robot}",
}
"""Places of encoders that hold their last value: events without a law."""
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
    if effect["cause"] in HELD:
        names.append(HELD[effect["cause"]].format(**here))
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
    """Signal of something located without a formula, as its kind says: ``... by its SIGNAL``."""
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


HEALTHY = ("consistent", "miscalibrated")
"""Verdicts that name no fault."""


@dataclass(frozen=True)
class Scored:
    """A whole result.

    Attributes:
        result: what was scored.
        scores: one for every hidden effect.
        extras: listed causes that were named besides and are not there.
        grounded: those that were named besides and are there, because the background drew them (``grounded``).
        strangers: what is named as unlisted and is not located right.
        stated: probability and rightness of everything that was named.
    """

    result: Item
    scores: tuple[Score, ...]
    extras: tuple[Item, ...]
    grounded: tuple[Item, ...]
    strangers: tuple[Item, ...]
    stated: tuple[tuple[float, bool], ...]

    @property
    def verdict(self) -> str:
        """The verdict's first word."""
        return self.result["verdict"]["verdict"]

    @property
    def laws(self) -> Sequence[Item]:
        """How well each unlisted effect was told (``law_score.LawScore``)."""
        return self.result["law_scores"]

    @property
    def right(self) -> int:
        """How many of the hidden effects are told right."""
        listed = sum(one.right for one in self.scores) + sum(bool(one["which"]) for one in self.laws)
        open_ = self.verdict in ("unexplained", "partly_explained") or "unlisted" in self._named
        return listed + (sum(map(_is_nobodys, self.scores)) if open_ else 0)

    @property
    def _named(self) -> set[str]:
        return {cause["cause"] for cause in self.result["verdict"]["causes"]}

    @property
    def certain(self) -> int:
        """How much was named with certainty and is not there."""
        return sum(p >= SURE and not right for p, right in self.stated)

    @property
    def whole(self) -> bool:
        """Whether everything hidden was told right, and nothing was named that is not there."""
        if self.extras or self.strangers:
            return False
        if not self.scores:
            return self.verdict in HEALTHY or (self.verdict == "explained" and bool(self.grounded))
        return self.right == len(self.scores)


def score(result: Item) -> Scored:
    """Score one result that ended without an error."""
    truth, set_ = result["truth"], result["set"]
    excluded = set(set_["names"]) if set_["kind"] == "left-out" else set()
    causes = [_as_told(cause) for cause in result["verdict"]["causes"] if cause["cause"] != "unlisted"]
    unlisted = [cause for cause in result["verdict"]["causes"] if cause["cause"] == "unlisted"]
    grounded = [c for c in causes if not _hidden(c, truth) and of_the_background(c, truth)]
    found = match(
        [c for c in causes if c not in grounded], truth, _factors(set_, truth["effects"]),
        lambda cause: cause in CAUSES and cause not in excluded,
    )  # fmt: skip
    located = {k for law in result["law_scores"] for k in law["which"]}
    loose = any(map(_is_nobodys, found.scores))
    told = [(c, loose or k in located) for k, c in enumerate(unlisted)]
    strangers = [c for c, right in told if not right]
    more = [(c, True) for c in grounded] + told
    there = [(float(c["probability"]), right) for c, right in more if c.get("probability") is not None]
    return Scored(
        result, found.scores, found.extras, tuple(grounded), tuple(strangers), (*found.stated, *there)
    )


def _is_nobodys(one: Score) -> bool:
    """Whether it is a cause that was left out: it may be told as unlisted wherever it shows."""
    return not one.listed and not one.effect.get("law")


def _as_told(cause: Item) -> Item:
    """A cause whose told set names none if something unlisted is in it."""
    if all(one["cause"] != "unlisted" for one in cause.get("told", ())):
        return cause
    return {**cause, "alternatives": [{**rival, "ambiguous": False} for rival in cause["alternatives"]]}


def _hidden(item: Item, truth: Item) -> bool:
    """Whether it is the right cause for something hidden, at a place that is right for it."""
    each = (match([item], {**truth, "effects": [effect]}, [1.0]).scores[0] for effect in truth["effects"])
    return any(one.member and one.place for one in each)


def _factors(request: Item, effects: Sequence[Item]) -> list[float]:
    if len(request["factors"]) == len(effects):
        return list(request["factors"])
    return [request["factors"][0]] * len(effects)  # pushes: one factor for all
