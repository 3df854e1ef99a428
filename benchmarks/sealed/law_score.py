"""Hold a law that a diagnosis states against the one that was hidden: place, signal, formula, size."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.campaign.ground import one_axis
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import omnid_design
from sealed.laws.hysteresis import BoucWen, Play
from sealed.unlisted.outside import SCRATCH_RAD, SLACK_RAD, SOFT_NM, YIELD_NM

Item = Mapping[str, Any]
Series = list[np.ndarray]
EVERY_S = 0.2
"""Between the instants at which two laws are compared."""
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
        beside: other laws and causes that were named.
    """

    stated: bool
    place: bool = False
    variable: bool = False
    formula: bool = False
    amplitude: float | None = None
    held_out: float | None = None
    beside: int = 0


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
            at = _instants(recording)
            values = rig.bench.values(t, law)[at] @ table
            trials.append({"time_s": recording.time[at].tolist(), "values": values.T.tolist()})
        out.append(trials)
    return out


def score_law(result: Item, trials: Sequence[Path]) -> LawScore:
    """The law of a result that comes nearest to its one unlisted effect."""
    (effect,) = result["truth"]["effects"]
    causes = result["verdict"]["causes"]
    laws = [cause for cause in causes if cause["cause"] == "law"]
    if not laws:
        return LawScore(stated=False, beside=len(causes))
    recordings = [read_recording(path) for path in trials]
    each = [
        _score(law, series, effect, result["truth"], recordings, len(causes) - 1)
        for law, series in zip(laws, result["verdict"]["law_series"], strict=True)
    ]
    return max(each, key=lambda one: (one.place, one.variable, one.formula))


def _score(
    law: Item, series: Sequence[Item], effect: Item, truth: Item, recordings: Sequence[Recording], beside: int
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
        beside=beside,
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
    "torque_backlash": ("play",), "torque_hum": ("hum",), "eccentric_phi": ("sine",), "eccentric_theta": ("sine",),
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
    "quadratic_reading": ({"tau"},), "angle_in_torque": ({"phi"},), "torque_backlash": ({"tau"},),
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
    true = _true_series(effect, recordings)
    if true is None:
        return math.inf, None
    sign = -1.0 if effect["law"]["of"] == "torque in driven joint" and said["place"] == "tau reading" else 1.0
    found = np.concatenate([np.array(one["values"]) for one in series], axis=1)
    wanted = sign * np.concatenate(true, axis=1)
    if len(found) != len(wanted):
        found = found[: len(wanted)] if len(found) > len(wanted) else found
    if len(found) != len(wanted):
        return math.inf, None
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


def _true_series(effect: Item, recordings: Sequence[Recording]) -> Series | None:
    p, here = effect["parameters"], effect["law"]["place"]
    if effect["cause"] not in SHAPES:
        return None
    out = []
    for recording in recordings:
        at = _instants(recording)
        values = SHAPES[effect["cause"]](_Seen(recording, here), p)
        out.append(np.atleast_2d(np.asarray(values, dtype=float))[:, at])
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
    "torque_backlash": lambda s, p: _behind(s.tau, p["half_width_Nm"]),
    "torque_hum": lambda s, p: p["amplitude_Nm"] * np.sin(2.0 * np.pi * p["frequency_hz"] * s.t),
    "eccentric_phi": lambda s, p: p["amplitude_rad"] * np.sin(s.phi + p["phase_rad"]),
    "eccentric_theta": lambda s, p: p["amplitude_rad"] * np.sin(s.theta + p["phase_rad"]),
    "cyclic_phi": lambda s, p: p["amplitude_rad"] * np.sin(16.0 * s.phi + p["phase_rad"]),
    "encoder_backlash": lambda s, p: _behind(s.phi, p["half_width_rad"]),
    "soft_encoder_mount": lambda s, p: p["rad_per_Nm"] * s.tau,
    "slipping_zero": lambda s, p: p["rate_radps"] * s.t,
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
"""What each does as a function of time, written apart from the forms and from the diagnosis."""


def _instants(recording: Recording) -> np.ndarray:
    """Samples at which laws are compared; the ends of a trial are left out, as the diagnosis does."""
    step = max(1, round(EVERY_S * recording.metadata.rate_hz))
    trim = round(2.0 * recording.metadata.rate_hz)
    return np.arange(trim, len(recording.time) - trim, step)
