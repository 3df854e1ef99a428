"""A team's causes in the words of a lab."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from discrepancy.causes.words import number
from discrepancy.rig import Candidate
from discrepancy.team.causes import CAUSES

GIMBAL_AXES = {1: "z (first)", 2: "y (middle)", 3: "x (last)"}
GIMBAL_CAUSES = ("theta_zero", "gimbal_friction")
UNITS = {"phi": "rad", "theta": "rad", "tau": "N m", "speed": "m/s", "position": "m", "load": "N m"}


@dataclass(frozen=True)
class _Numbers:
    """Parameters of one cause, to be put into a sentence."""

    values: Mapping[str, float]
    se: Mapping[str, float]

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        value = self.values[name] if signed else abs(self.values[name])
        return number(value, self.se.get(name), unit, scale)

    def vector(self, stem: str, ends: str, unit: str, scale: float = 1.0) -> str:
        names = [f"{stem}_{axis}_{ends}" for axis in "xyz"]
        inner = ", ".join(number(self.values[name], self.se.get(name), "", scale) for name in names)
        return f"({inner}) {unit}"

    def much(self, name: str) -> str:
        return "too much" if self.values[name] >= 0 else "too little"

    def long(self, name: str) -> str:
        return "too long" if self.values[name] >= 0 else "too short"


def _link_length(n: _Numbers) -> str:
    parts = {
        "proximal_m": "the driven link is",
        "rod_m": "the rods are",
        "base_radius_m": "the base radius is",
    }
    words = [
        f"{what} {n(name, 'mm', 1e3)} {n.long(name)}" for name, what in parts.items() if n.values.get(name)
    ]
    return "the leg deviates from its design: " + (", ".join(words) or "by nothing that shows")


def _friction(n: _Numbers, what: str) -> str:
    return (
        f"{what} rubs with {n('coulomb_Nm', 'N m')} (Coulomb, while it moves) and "
        f"{n('viscous_Nms_per_rad', 'N m s/rad')} (viscous)"
    )


SENTENCES: dict[str, Callable[[_Numbers], str]] = {
    "phi_zero": lambda n: (
        f"the encoder of the driven joint reads {n('zero_rad', 'mrad', 1e3)} {n.much('zero_rad')}"
    ),
    "theta_zero": lambda n: (
        f"the encoder of the gimbal joint reads {n('zero_rad', 'mrad', 1e3)} {n.much('zero_rad')}"
    ),
    "link_length": _link_length,
    "base_tilt": lambda n: (
        f"the base does not stand level: turned by {n('roll_rad', 'mrad', 1e3, signed=True)} about its x axis and "
        f"{n('pitch_rad', 'mrad', 1e3, signed=True)} about its y axis"
    ),
    "base_creep": lambda n: (
        f"the base creeps over the floor, by {n('x_mps', 'um/min', 6e7, signed=True)} along its x axis and "
        f"{n('y_mps', 'um/min', 6e7, signed=True)} along its y axis"
    ),
    "base_compliance": lambda n: (
        f"the base gives way horizontally, by {n('compliance_m_per_N', 'um/N', 1e6)}"
    ),
    "sea_scale": lambda n: (
        f"the spring is {n('scale', '%', 1e2)} {'stiffer' if n.values['scale'] >= 0 else 'softer'} than assumed, so "
        f"the torque is read {'too small' if n.values['scale'] >= 0 else 'too large'}"
    ),
    "sea_bias": lambda n: f"the torque sensor reads {n('bias_Nm', 'N m')} {n.much('bias_Nm')}",
    "sea_hardening": lambda n: (
        f"the spring {'hardens' if n.values['cubic_Nm_per_rad3'] >= 0 else 'softens'} with its deflection, by "
        f"{n('cubic_Nm_per_rad3', 'N m/rad^3')} (cubic)"
    ),
    "sea_hysteresis": lambda n: f"the spring rubs inside, with {n('friction_Nm', 'N m')}",
    "joint_friction": lambda n: _friction(n, "the driven joint"),
    "gimbal_friction": lambda n: _friction(n, "the gimbal joint"),
    "torque_skew": lambda n: (
        f"the torques are logged {n('delay_s', 'ms', 1e3, signed=True)} later than the angles"
    ),
    "torque_lag": lambda n: (
        f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"
    ),
    "clock_delay": lambda n: (
        f"all that it logs is {n('delay_s', 'ms', 1e3)} {'late' if n.values['delay_s'] >= 0 else 'early'}"
    ),
    "grasp_flex": lambda n: f"the grasp is flexible and gives way by {n('compliance_m_per_N', 'um/N', 1e6)}",
    "grasp_play": lambda n: f"the grasp is loose by +-({n('play_m', 'um', 1e6)}) along each axis",
    "tether": lambda n: (
        f"something like a cable pulls at the grasp with {n('stiffness_N_per_m', 'N/m')} towards "
        f"{n.vector('anchor', 'm', 'm')} in its base frame"
    ),
    "push": lambda n: (
        f"something pushed the payload in trial {n.values['trial']:.0f} from {n.values['start_s']:.2f} s on for "
        f"{n.values['duration_s']:.2f} s, with {n.vector('force', 'N', 'N')} along a line "
        f"through {n.vector('point', 'm', 'm')} in {{1}}"
    ),
    "drag": lambda n: (
        f"the payload's motion is resisted by {n('coefficient_Ns_per_m', 'N s/m', signed=True)}"
    ),
    "slosh": lambda n: (
        f"a mass of {n('mass_kg', 'kg', signed=True)} swings in the payload on {n('length_m', 'm')} below "
        f"{n.vector('point', 'm', 'm')} in {{1}} (damping ratio {n('damping_ratio', '')})"
    ),
}


class TeamWords:
    """``Words`` of a mocobot team."""

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """One sentence; a cause without one of its own here gets the first line of its docstring."""
        template = SENTENCES.get(candidate.cause)
        if template is not None:
            what = template(_Numbers(values, se))
        else:
            said = (inspect.getdoc(CAUSES[candidate.cause]) or candidate.cause).splitlines()[0].rstrip(".")
            numbers = ", ".join(
                f"{name} = {number(v, se.get(name, np.nan), '')}" for name, v in values.items()
            )
            what = f"{said} ({numbers})"
        return f"{_place(candidate)}: {what}."

    def separate(self, cause: str) -> str:
        """The catalogue's advice."""
        return CAUSES[cause].separate

    def unit(self, name: str) -> str:
        """Unit of a closed-loop channel or an explanatory quantity."""
        return UNITS[name]


def _place(candidate: Candidate) -> str:
    if candidate.robot is None:
        return "Payload"
    if candidate.joint is None:
        return f"Robot {candidate.robot}"
    if candidate.cause in GIMBAL_CAUSES:
        return f"Robot {candidate.robot}, gimbal joint {candidate.joint}, axis {GIMBAL_AXES[candidate.joint]}"
    return f"Robot {candidate.robot}, joint {candidate.joint}"
