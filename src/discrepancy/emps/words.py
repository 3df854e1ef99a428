"""The axis' causes in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from discrepancy.causes.numbers import number
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG
from discrepancy.rig import Candidate

UNITS = {
    "position": "m", "voltage": "V", "force": "N", "speed": "m/s", "velocity": "m/s", "acceleration": "m/s^2"
}  # fmt: skip


class _Numbers:
    """Parameters of one cause, to be put into a sentence."""

    def __init__(self, values: Mapping[str, float], se: Mapping[str, float]) -> None:
        self.values, self.se = values, se

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        value = self.values[name] if signed else abs(self.values[name])
        return number(value, self.se.get(name), unit, scale)

    def more(self, name: str, more: str, less: str) -> str:
        return more if self.values[name] >= 0 else less


def _train(n: _Numbers) -> str:
    start, period, width = (n.values[name] for name in ("start_s", "period_s", "width_s"))
    begin = f"from {start:.4g} s on" if start >= 0 else "since before the recording began"
    return f"rectangular pulses {begin}, every {period:.5g} s for {width:.4g} s"


def _mass(n: _Numbers) -> str:
    total = number(FIRST_GUESS_KG + n.values["excess_kg"], n.se.get("excess_kg"), "kg")
    return f"the axis moves {total}, {n('excess_kg', 'kg')} {n.more('excess_kg', 'more', 'less')} than first guessed"


SENTENCES: dict[str, Callable[[_Numbers], str]] = {
    "mass": _mass,
    "coulomb_friction": lambda n: f"rubs with {n('coulomb_N', 'N')} (Coulomb, while it moves)",
    "viscous_friction": lambda n: f"rubs with {n('viscous_Ns_per_m', 'N s/m')} (viscous)",
    "asymmetric_coulomb": lambda n: (
        f"dry friction is {n('asymmetry_N', 'N')} {n.more('asymmetry_N', 'larger', 'smaller')} forwards and as much "
        f"{n.more('asymmetry_N', 'smaller', 'larger')} backwards"
    ),
    "asymmetric_viscous": lambda n: (
        f"viscous friction is {n('asymmetry_Ns_per_m', 'N s/m')} {n.more('asymmetry_Ns_per_m', 'larger', 'smaller')} "
        f"forwards and as much {n.more('asymmetry_Ns_per_m', 'smaller', 'larger')} backwards"
    ),
    "stribeck": lambda n: (
        f"near standstill dry friction is {n('excess_N', 'N')} {n.more('excess_N', 'larger', 'smaller')} than in fast "
        f"motion, fading over {n('speed_mps', 'mm/s', 1e3)}"
    ),
    "force_offset": lambda n: (
        f"a constant force of {n('resisting_N', 'N')} {n.more('resisting_N', 'resists', 'helps')} forward motion"
    ),
    "position_force": lambda n: (
        f"a force repeats along the way every {n.values['wavelength_m'] * 1e3:.4f} mm, with "
        f"{n('cosine_N', 'N', signed=True)} (cosine) and {n('sine_N', 'N', signed=True)} (sine)"
    ),
    "backlash": lambda n: f"motor and carriage have a play of {n('play_m', 'um', 1e6)} in all",
    "delay": lambda n: (
        f"the force follows the voltage {n('delay_s', 'ms', 1e3)} {n.more('delay_s', 'later', 'earlier')} than its "
        "hold alone would"
    ),
    "position_gain": lambda n: (
        f"the position loop's gain is {n('excess_per_s', '1/s')} {n.more('excess_per_s', 'above', 'below')} its "
        "nominal value"
    ),
    "velocity_gain": lambda n: (
        f"the velocity loop's gain is {n('excess_Vs_per_m', 'V s/m')} {n.more('excess_Vs_per_m', 'above', 'below')} "
        "its nominal value"
    ),
    "velocity_lag": lambda n: (
        f"the velocity that the loop uses is {n('lag_s', 'ms', 1e3)} {n.more('lag_s', 'old', 'ahead')}"
    ),
    "injected_voltage": lambda n: (
        f"something adds {n('size_V', 'V', signed=True)} between the law and the drive: {_train(n)}"
    ),
    "injected_force": lambda n: (
        f"something {n.more('resisting_N', 'resists', 'helps')} forward motion with {n('resisting_N', 'N')}: "
        f"{_train(n)}"
    ),
    "push": lambda n: (
        f"something pushed with {n('force_N', 'N', signed=True)} from {n.values['start_s']:.3f} s on for "
        f"{n.values['duration_s']:.3f} s"
    ),
}


class EmpsWords:
    """``Words`` of the axis."""

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """One sentence."""
        what = SENTENCES[candidate.cause](_Numbers(values, se))
        return f"{candidate.place.capitalize()}: {what}."

    def separate(self, cause: str) -> str:
        """The catalogue's advice."""
        return CAUSES[cause].separate

    def unit(self, name: str) -> str:
        """Unit of a closed-loop channel or an explanatory quantity."""
        return UNITS[name]
