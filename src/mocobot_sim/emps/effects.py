"""What can be off at the axis, by name: every effect changes numbers of the plant."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mocobot_sim.emps.law import AxisLaw
from mocobot_sim.emps.plant import ForcePush, Plant, PulseTrain, Ripple


@dataclass(frozen=True)
class AxisEffect:
    """One effect.

    Attributes:
        cause: a key of ``CHANGES``.
        parameters: by name, units in the names; a law has names among them.
    """

    cause: str
    parameters: Mapping[str, Any]

    def changes(self, plant: Plant) -> dict[str, Any]:
        """The plant's numbers that it changes, as they are then."""
        return CHANGES[self.cause](plant, **self.parameters)


def apply_effects(plant: Plant, effects: Sequence[AxisEffect]) -> Plant:
    """The plant with effects in it, one after the other."""
    for effect in effects:
        plant = replace(plant, **effect.changes(plant))
    return plant


def _added(pair: tuple[float, float], forward: float, backward: float) -> tuple[float, float]:
    return pair[0] + forward, pair[1] + backward


# Dry friction has no width here: the speed ``slow_mps`` below which it fades is that of a smooth model of it.
CHANGES: dict[str, Callable[..., dict[str, Any]]] = {
    "mass": lambda plant, excess_kg: {"mass_kg": max(plant.mass_kg + excess_kg, 1.0)},
    "coulomb_friction": lambda plant, coulomb_N, slow_mps=0.0: {
        "coulomb_N": _added(plant.coulomb_N, coulomb_N, coulomb_N)
    },
    "viscous_friction": lambda plant, viscous_Ns_per_m: {
        "viscous_Ns_per_m": _added(plant.viscous_Ns_per_m, viscous_Ns_per_m, viscous_Ns_per_m)
    },
    "asymmetric_coulomb": lambda plant, asymmetry_N, slow_mps=0.0: {
        "coulomb_N": _added(plant.coulomb_N, asymmetry_N, -asymmetry_N)
    },
    "asymmetric_viscous": lambda plant, asymmetry_Ns_per_m: {
        "viscous_Ns_per_m": _added(plant.viscous_Ns_per_m, asymmetry_Ns_per_m, -asymmetry_Ns_per_m)
    },
    "stribeck": lambda plant, excess_N, speed_mps: {
        "stribeck_N": plant.stribeck_N + excess_N, "stribeck_mps": speed_mps
    },
    "force_offset": lambda plant, resisting_N: {"resisting_N": plant.resisting_N + resisting_N},
    "position_force": lambda plant, wavelength_m, cosine_N, sine_N: {
        "ripples": (*plant.ripples, Ripple(wavelength_m, cosine_N, sine_N))
    },
    "backlash": lambda plant, play_m: {"play_m": max(plant.play_m + play_m, 0.0)},
    "delay": lambda plant, delay_s: {"delay_s": max(plant.delay_s + delay_s, 0.0)},
    "position_gain": lambda plant, excess_per_s: {"kp_per_s": plant.kp_per_s + excess_per_s},
    "velocity_gain": lambda plant, excess_Vs_per_m: {"kv_Vs_per_m": plant.kv_Vs_per_m + excess_Vs_per_m},
    "velocity_lag": lambda plant, lag_s: {"velocity_lag_s": max(plant.velocity_lag_s + lag_s, 0.0)},
    "injected_voltage": lambda plant, size_V, **times: {
        "voltage_pulses": (*plant.voltage_pulses, PulseTrain(**times, size=size_V))
    },
    "injected_force": lambda plant, resisting_N, **times: {
        "force_pulses": (*plant.force_pulses, PulseTrain(**times, size=resisting_N))
    },
    "push": lambda plant, force_N, **times: {"pushes": (*plant.pushes, ForcePush(**times, force_N=force_N))},
    "law": lambda plant, **formula: {"laws": (*plant.laws, AxisLaw(**formula))},
}  # fmt: skip
"""Changed numbers of the plant from plant and parameters, for every cause of the diagnosis' catalogue."""
