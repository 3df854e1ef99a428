"""Unlisted effects as functions of time, written apart from the forms and from the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.recording.model import Recording
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import omnid_design
from sealed.laws.hysteresis import BoucWen, Play
from sealed.unlisted.outside import SCRATCH_RAD, SLACK_RAD, SOFT_NM, YIELD_NM

Item = Mapping[str, Any]
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
