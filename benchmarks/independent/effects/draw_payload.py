"""Effects on the payload: parameters of a given size, points within its grasps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from independent.as_built import ROBOTS
from independent.effects.draw_robot import Drawn, Rng, Setting
from independent.effects.on_payload import AddedMass, Drag, Pendulum, Push, Tether
from independent.numerics import Array

_SPEED_MPS, _ARM2 = 0.08, 0.25
"""Usual speed of the payload, and the square of how far from its centre something that drags is [m^2]."""


def tether(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A spring from a grasp to a point fixed to its base."""
    return _tether(rng, size, setting, of_payload=False, slack=False)


def tether_slack(rng: Rng, size: float, setting: Setting) -> Drawn:
    """The same as a cable that hangs slack wherever the grasp comes near its anchor."""
    return _tether(rng, size, setting, of_payload=False, slack=True)


def payload_tether(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A spring from any point of the payload to one fixed to robot 1's base."""
    return _tether(rng, size, setting, of_payload=True, slack=False)


def payload_tether_slack(rng: Rng, size: float, setting: Setting) -> Drawn:
    """The same as a cable."""
    return _tether(rng, size, setting, of_payload=True, slack=True)


def push(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A push that starts and ends at once."""
    return _push(rng, size, setting, "square")


def push_half_sine(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A push that swells and fades."""
    return _push(rng, size, setting, "half_sine")


def push_trapezoid(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A push with ramps, which the catalogue's ``ramp_s`` tells too."""
    return _push(rng, size, setting, "trapezoid")


def drag(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Against the velocity of the centre of mass."""
    value = size * setting.limit("drag")
    return Drawn(Drag(value), known={"coefficient_Ns_per_m": value})


def drag_turning(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Against its rotation too."""
    value = size * setting.limit("drag")
    turning = value * _ARM2 * rng.uniform(0.5, 1.5)
    return Drawn(Drag(value, turning), known={"coefficient_Ns_per_m": value, "turning_Nms_per_rad": turning})


def drag_quadratic(rng: Rng, size: float, setting: Setting) -> Drawn:
    """With the square of the speed, as large at a usual speed."""
    value = size * setting.limit("drag") / _SPEED_MPS
    return Drawn(Drag(0.0, 0.0, value), known={"quadratic_Ns2_per_m2": value})


def slosh(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A pendulum."""
    point, mass = _point(rng, setting), size * setting.limit("slosh")
    length, ratio = rng.uniform(0.1, 0.4), rng.uniform(0.005, 0.05)
    known = {"mass_kg": mass, "length_m": length, "damping_ratio": ratio} | _named(point, "point_{}_m")
    return Drawn(Pendulum(_triple(point), mass, length, ratio), known=known)


def payload_mass(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Mass that is there in some trials only, or that leaks from the start of every trial."""
    point, value = _point(rng, setting), size * setting.limit("payload_mass")
    named = _named(point, "point_{}_m")
    if rng.random() < 0.5:
        rate = -value / 60
        effect = AddedMass(_triple(point), rate_kgps=rate)
        return Drawn(effect, known={"rate_kgps": rate} | named)
    first, last = ((2, 4), (3, 4), (4, 4), (2, 3))[rng.integers(4)]
    known = {"mass_kg": value, "trial": first, "last_trial": last} | named
    return Drawn(AddedMass(_triple(point), value, first=first, last=last), known=known)


def mass_settling(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Mass that leaks fast at first and then ever more slowly."""
    point, settling = _point(rng, setting), rng.uniform(8.0, 20.0)
    rate = -size * setting.limit("payload_mass") / settling
    effect = AddedMass(_triple(point), rate_kgps=rate, settling_s=settling)
    told = {"first_rate_kgps": rate, "settling_s": settling} | _named(point, "point_{}_m")
    return Drawn(effect, known={}, parameters=told)


def _tether(rng: Rng, size: float, setting: Setting, *, of_payload: bool, slack: bool) -> Drawn:
    """At home it pulls with the limit's force times ``size``, in any direction."""
    base = 0 if of_payload else int(rng.integers(ROBOTS))
    stiffness = rng.uniform(0.5, 5.0)
    stretch, length = setting.limit("tether") / stiffness, rng.uniform(0.15, 0.5) if slack else 0.0
    point = _point(rng, setting) if of_payload else setting.payload.p_1i[base]
    home = setting.bases.p_W1 + setting.bases.R_W1 @ point
    way = rng.normal(0.0, 1.0, 3)
    way *= (stretch + length) / np.linalg.norm(way)
    anchor = setting.bases.R_Wb[base].T @ (home - setting.bases.p_Wb[base]) + way
    effect = Tether(base, None, _triple(anchor), stiffness * size, length)
    known: dict[str, Any] = {"stiffness_N_per_m": stiffness * size} | _named(anchor, "anchor_{}_m")
    if slack:
        known["length_m"] = length
    if not of_payload:
        return Drawn(effect, base, None, known)
    known |= _named(point, "point_{}_m")
    return Drawn(replace(effect, point=_triple(point)), known=known)


def _push(rng: Rng, size: float, setting: Setting, shape: str) -> Drawn:
    """The longer, the weaker: what shows is the force times the square root of the time."""
    trial, duration = int(rng.integers(1, 1 + len(setting.durations_s))), rng.uniform(1.0, 10.0)
    start = rng.uniform(3.0, setting.durations_s[trial - 1] - duration - 3.0)
    force = rng.normal(0.0, 1.0, 3)
    force *= size * setting.limit("push") / np.sqrt(duration) / np.linalg.norm(force)
    point = _point(rng, setting)
    effect = Push(trial, start, duration, _triple(force), _triple(point), shape)
    known: dict[str, Any] = {"trial": trial, "start_s": start, "duration_s": duration}
    known |= _named(force, "force_{}_N") | _named(point, "point_{}_m")
    if shape == "trapezoid":
        known["ramp_s"] = duration / 4
    return Drawn(effect, known=known, parameters={"shape": shape})


def _point(rng: Rng, setting: Setting) -> Array:
    """A point of {1} somewhere between the grasps."""
    return rng.dirichlet(np.ones(ROBOTS)) @ setting.payload.p_1i + rng.uniform(-0.05, 0.10, 3)


def _named(values: Array, name: str) -> dict[str, float]:
    return {name.format(axis): float(value) for axis, value in zip("xyz", values, strict=True)}


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
