"""Names of a calibration's parameters in words, and their units."""

from discrepancy.joints.causes import SHOWN

WORDS = {
    "coulomb": "Coulomb friction", "viscous": "viscous friction", "armature": "reflected inertia",
    "offset": "torque offset", "gain": "torque gain", "delay": "torque delay", "command": "command", "zero": "zero",
    "position": "frame position", "braking": "back-EMF", "tilt": "tilt", "coupled": "coupled", "mass": "mass",
    "com": "centre of mass", "inertia": "inertia", "limit": "largest torque",
}  # fmt: skip
UNITS = {
    "Nms_per_rad": "N m s/rad", "Nm_per_rad": "N m/rad", "N_per_m": "N/m", "kgm2": "kg m^2",
    "Nm": "N m", "Ns_per_m": "N s/m", "rad": "rad", "kg": "kg", "m": "m", "N": "N", "s": "s",
}  # fmt: skip
SMALL = {"rad": ("mrad", 1e3), "m": ("mm", 1e3), "s": ("ms", 1e3)}


def described(name: str) -> tuple[str, str, float]:
    """A parameter in words, its unit and the factor to it."""
    stem, _, rest = name.partition("_")
    if stem == "gain":
        return f"{WORDS[stem]} error", "%", 100.0
    suffix = next(s for s in UNITS if name.endswith(f"_{s}"))
    if name.startswith("position_gain_"):
        return "position gain", UNITS[suffix], 1.0
    words, middle = WORDS[stem], rest.removesuffix(suffix).strip("_").replace("_", " ")
    unit, scale = SMALL.get(UNITS[suffix], (UNITS[suffix], 1.0))
    middle = "delay" if stem == "command" else WORDS.get(middle, middle)
    return (
        f"{words} {middle}".strip(),
        SHOWN.get(unit, unit) if unit == "N m" and suffix == "N" else unit,
        scale,
    )
