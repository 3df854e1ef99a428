"""Table of causes at a joint with their regressor columns, and of all other causes with their sentences."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.numbers import Numbers, number
from estimator.arrays import Array

Shape = Mapping[str, float]
SLIDES = {
    "Nms_per_rad": "Ns_per_m", "Nm_per_rad": "N_per_m", "rad_per_Nm": "m_per_N", "rad_per_s": "m_per_s", "Nm": "N",
    "rad": "m", "kgm2": "kg",
}  # fmt: skip
"""Unit suffixes of parameter names: revolute joint to prismatic joint."""
SHOWN = {
    "N m s/rad": "N s/m", "N m/rad": "N/m", "mrad per N m": "mm per N", "N m": "N", "mrad": "mm", "rad": "m",
    "rad/s": "m/s", "kg m^2": "kg",
}  # fmt: skip
"""The same for units in sentences."""


def parameter_name(name: str, *, slide: bool) -> str:
    """Convert the unit suffix of a parameter name to that of a prismatic joint if ``slide``."""
    for turning, sliding in SLIDES.items() if slide else ():
        if name.endswith(f"_{turning}"):
            return f"{name.removesuffix(turning)}{sliding}"
    return name


def joint_in_words(joint: int, called: str) -> str:
    """A joint in words, as in ``joint 3 (elbow)``; the number alone if the name adds nothing."""
    plain = re.fullmatch(rf"(joint|j|axis|link)?[ _-]?0*{joint}", called, re.IGNORECASE)
    return f"joint {joint}" if plain or not called else f"joint {joint} ({called})"


def link_in_words(body: str) -> str:
    """A link in words, as in ``link hand``; the name alone if it contains "link"."""
    return body if re.search(r"\blink", body, re.IGNORECASE) else f"link {body}"


def titled(title: str, place: str = "") -> str:
    """Fill the place into a title such as ``friction in {joint}``; without a place, use "a joint"."""
    return re.sub(r"\{(.*?)\}", lambda part: place or _some(part[1]), title)


def _some(part: str) -> str:
    return "two joints" if part == "pair" else f"a {part}"


@dataclass(frozen=True)
class Said(Numbers):
    """Parameters of one cause for a sentence about its place.

    Attributes:
        place: in words.
        slide: whether the joint is prismatic.
        than: what it is compared with, such as ``than modelled``.
    """

    place: str = ""
    slide: bool = False
    than: str = "than modelled"

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        return super().__call__(self._name(name), self._unit(unit), scale, signed=signed)

    def either(self, name: str, more: str, less: str) -> str:
        return super().either(self._name(name), more, less)

    def value(self, name: str) -> float:
        """Value of a parameter by its name for a revolute joint; 0 if it is missing."""
        return self.values.get(self._name(name), 0.0)

    def also(self, text: str, name: str, unit: str) -> str:
        """Fill a chosen (not fitted) parameter into a text at ``{}``; empty if the parameter is missing."""
        found = self.values.get(self._name(name))
        return "" if found is None else text.format(number(found, None, self._unit(unit)))

    def point(self, unit: str, scale: float) -> str:
        """Position or force vector ``(x, y, z) unit`` from parameters such as ``x_m``."""
        names = [name for name in self.values if re.fullmatch(r"[xyz]_\w+", name)]
        return f"({', '.join(number(self.values[n], self.se.get(n), '', scale) for n in names)}) {unit}"

    def _name(self, name: str) -> str:
        sliding = parameter_name(name, slide=self.slide)
        return sliding if sliding in self.values else name

    def _unit(self, unit: str) -> str:
        return SHOWN.get(unit, unit) if self.slide else unit


@dataclass(frozen=True, eq=False)
class JointSignals:
    """Signals of one joint in one log, W samples.

    Attributes:
        q, v, a: position [rad or m] and its derivatives, shape (W,).
        direction: direction of motion from -1 to 1, shape (W,).
        load: modelled torque without friction and rotor inertia [N m or N], shape (W,).
        asked: modelled torque with friction and rotor inertia [N m or N], shape (W,).
        torque: measured torque, shape (W,).
        by_delay: residual torque per second of delay, shape (W,).
        t: time [s], shape (W,).
        span: typical sizes over all logs.
    """

    q: Array
    v: Array
    a: Array
    direction: Array
    load: Array
    asked: Array
    torque: Array
    by_delay: Array
    t: Array
    span: Span

    @property
    def step_s(self) -> float:
        """Time between samples [s]."""
        return float(self.t[1] - self.t[0])


@dataclass(frozen=True)
class Span:
    """Typical sizes of one joint over all logs, from which priors are derived.

    Attributes:
        torque, speed, acceleration: root mean squares.
        travel, middle: range of the position, and its centre.
        until_s: latest sample time in all logs [s].
    """

    torque: float
    speed: float
    acceleration: float
    travel: float
    middle: float
    until_s: float


@dataclass(frozen=True)
class JointCause:
    """One cause at a joint with k parameters.

    Attributes:
        name: identifier in results.
        title: name in words; ``{joint}`` stands for the place.
        parameters: k parameter names with units of a revolute joint.
        columns: function of (signals, shape) that returns k series (W,) [N m or N per unit].
        slab: function of (span, shape) that returns the k prior standard deviations if the cause is present.
        shapes: shapes to try: parameters that the columns depend on nonlinearly.
        positive: parameters that cannot be negative in sum with the model's own value.
        kind: whether all joints may have it alike, as a cause of the whole robot.
        rubs: function of (first parameter, span) that returns the Coulomb friction at rest; None: no friction at rest.
        loose: factor on the usual error of its law; friction laws are inexact.
        sentence: its effect with values and place; None: list the values.
        separate: experiment that separates it from similar causes.
    """

    name: str
    title: str
    parameters: tuple[str, ...]
    columns: Callable[[JointSignals, Shape], Sequence[Array]]
    slab: Callable[[Span, Shape], Sequence[float]]
    shapes: tuple[Shape, ...] = ({},)
    positive: tuple[str, ...] = ()
    kind: bool = False
    rubs: Callable[[float, Span], float] | None = None
    loose: float = 1.0
    sentence: Callable[[Said], str] | None = None
    separate: str = ""


@dataclass(frozen=True, eq=False)
class OtherCause:
    """One cause that is more than columns of one joint; attributes as in ``JointCause``."""

    name: str
    title: str
    parameters: tuple[str, ...]
    sentence: Callable[[Said], str]
    separate: str


def _faded(s: JointSignals, h: Shape) -> Array:
    return np.exp(-s.t / (h["share"] * s.span.until_s))


def _scaled(s: JointSignals, h: Shape) -> Array:
    typical = float(np.sqrt(np.mean(s.asked**2))) or 1.0
    return s.asked * (1.0 + h["bend"] * (np.abs(s.asked) / typical - 1.0))


def _as_on(turned_deg: float) -> str:
    """How a base is turned, in words that a look at the robot confirms."""
    if turned_deg > 135.0:
        return " over, as on a ceiling"
    return " on its side, as on a wall" if turned_deg > 45.0 else f" by {turned_deg:.0f} deg"


def _bent(n: Said) -> str:
    if not n.value("bend"):
        return ""
    more = "more" if n.value("bend") > 0.0 else "less"
    load, share = n.also(" of {}", "typical_load_Nm", "N m"), 100.0 * abs(n.value("bend"))
    return f", and at twice its typical load{load} {share:.2g} % of that {more}"


def _neutral(n: Said) -> str:
    at = n.value("middle_rad") - n.value("offset_Nm") / (n.value(STIFFNESS) or 1.0)
    return f"{at:.3g} {'m' if n.slide else 'rad'}"


def _again(n: Said) -> str:
    turns = n.value("turns")
    return f"every {2.0 * np.pi / turns:.3g} m" if n.slide and turns else f"{turns:.4g} times in a turn"


def _read_at(n: Said) -> str:
    where = "in front of" if n.value("side") > 1.0 else "behind"
    return f"; its position is read {where} it" if "side" in n.values else ""


def _springs(n: Said, unit: str) -> str:
    names = [f"stiffness_{axis}_{unit}" for axis in "xyz"]
    return f"({', '.join(number(n.value(name), n.se.get(name), '') for name in names)})"


VISCOUS, ASYMMETRY = "viscous_Nms_per_rad", "asymmetry_Nms_per_rad"
WARM, STIFFNESS = "more_Nms_per_rad", "stiffness_Nm_per_rad"
SHARES = ({"share": 0.1}, {"share": 0.3}, {"share": 1.0})
SPEEDS = ({"share": 0.05}, {"share": 0.1}, {"share": 0.2})
CAUSES = (
    JointCause(
        "friction", "friction in {joint}", ("coulomb_Nm", "viscous_Nms_per_rad"),
        lambda s, h: (s.direction, s.v), lambda z, h: (z.torque, z.torque / z.speed),
        positive=("coulomb_Nm", "viscous_Nms_per_rad"), kind=True, rubs=lambda x, z: x,
        loose=2.0,
        sentence=lambda n: (
            f"{n.place} rubs with {n('coulomb_Nm', 'N m')} {n.either('coulomb_Nm', 'more', 'less')} {n.than} (Coulomb) "
            f"and {n(VISCOUS, 'N m s/rad')} {n.either(VISCOUS, 'more', 'less')} (viscous)"
        ),
        separate="Move at several steady speeds in either direction.",
    ),
    JointCause(
        "torque_offset", "offset of the torque of {joint}", ("offset_Nm",),
        lambda s, h: (np.ones_like(s.q),), lambda z, h: (z.torque,), kind=True,
        sentence=lambda n: (
            f"the torque of {n.place} reads {n('offset_Nm', 'N m')} {n.either('offset_Nm', 'too much', 'too little')}"
        ),
        separate="Read the torque without power.",
    ),
    JointCause(
        "armature", "rotor inertia of {joint}", ("armature_kgm2",),
        lambda s, h: (s.a,), lambda z, h: (z.torque / z.acceleration,), positive=("armature_kgm2",), kind=True,
        sentence=lambda n: (
            f"the rotor of {n.place} adds {n('armature_kgm2', 'kg m^2')} "
            f"{n.either('armature_kgm2', 'more', 'less')} {n.than}"
        ),
        separate="Move this joint alone, fast and a short way, in a pose where gravity does not load it.",
    ),
    JointCause(
        "torque_scale", "scale of the torque of {joint}", ("scale",),
        lambda s, h: (_scaled(s, h),), lambda z, h: (0.5,), ({"bend": 0.0}, {"bend": -0.1}, {"bend": 0.1}), kind=True,
        sentence=lambda n: (
            f"the torque of {n.place} reads {n('scale', '%', 100.0)} {n.either('scale', 'too much', 'too little')}"
            + _bent(n)
        ),
        separate="Put a known weight on the arm.",
    ),
    JointCause(
        "torque_delay", "delay of the torque of {joint}", ("delay_s",),
        lambda s, h: (s.by_delay,), lambda z, h: (0.02,), kind=True,
        sentence=lambda n: (
            f"the torque of {n.place} comes {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"
        ),
        separate="Clamp the joint and step its torque.",
    ),
    JointCause(
        "stribeck", "Stribeck friction in {joint}", ("excess_Nm",),
        lambda s, h: (s.direction * np.exp(-np.abs(s.v) / (h["share"] * s.span.speed)),), lambda z, h: (z.torque,),
        SPEEDS, rubs=lambda x, z: x,
        loose=2.0,
        sentence=lambda n: (
            f"near standstill {n.place} rubs with {n('excess_Nm', 'N m')} {n.either('excess_Nm', 'more', 'less')} "
            f"than in fast motion{n.also(', fading over {}', 'fade_rad_per_s', 'rad/s')}"
        ),
        separate="Move steadily at low speeds.",
    ),
    JointCause(
        "asymmetric_coulomb", "Coulomb friction in {joint} that differs by direction", ("asymmetry_Nm",),
        lambda s, h: (np.abs(s.direction),), lambda z, h: (z.torque,),
        loose=2.0,
        sentence=lambda n: (
            f"dry friction of {n.place} is {n('asymmetry_Nm', 'N m')} "
            f"{n.either('asymmetry_Nm', 'larger', 'smaller')} forwards and as much "
            f"{n.either('asymmetry_Nm', 'smaller', 'larger')} backwards"
        ),
        separate="From rest, raise the torque slowly in either direction until the joint breaks loose.",
    ),
    JointCause(
        "asymmetric_viscous", "viscous friction in {joint} that differs by direction", ("asymmetry_Nms_per_rad",),
        lambda s, h: (np.abs(s.v),), lambda z, h: (z.torque / z.speed,),
        loose=2.0,
        sentence=lambda n: (
            f"viscous friction of {n.place} is {n(ASYMMETRY, 'N m s/rad')} {n.either(ASYMMETRY, 'larger', 'smaller')} "
            f"forwards and as much {n.either(ASYMMETRY, 'smaller', 'larger')} backwards"
        ),
        separate="Move at several steady speeds in either direction.",
    ),
    JointCause(
        "sublinear_friction", "sublinear friction in {joint}", ("bend_Nm",),
        lambda s, h: (s.direction * np.log1p(np.abs(s.v) / (h["share"] * s.span.speed)),), lambda z, h: (z.torque,),
        SHARES,
        loose=2.0,
        sentence=lambda n: (
            f"friction of {n.place} {n.either('bend_Nm', 'grows', 'falls')} by {n('bend_Nm', 'N m')} times the "
            f"logarithm of 1 + speed{n.also(' over {}', 'thins_rad_per_s', 'rad/s')}"
        ),
        separate="Move at several steady speeds: friction over speed bends.",
    ),
    JointCause(
        "load_friction", "friction by load in {joint}", ("share",),
        lambda s, h: (s.direction * np.abs(s.load),), lambda z, h: (0.3,), rubs=lambda x, z: x * z.torque,
        loose=2.0,
        sentence=lambda n: (
            f"friction of {n.place} {n.either('share', 'grows', 'falls')} by {n('share', '%', 100.0)} of its load"
        ),
        separate="Repeat one steady motion under several loads.",
    ),
    JointCause(
        "warming", "fading friction in {joint}", ("more_Nm", "more_Nms_per_rad"),
        lambda s, h: (s.direction * _faded(s, h), s.v * _faded(s, h)), lambda z, h: (z.torque, z.torque / z.speed),
        SHARES, rubs=lambda x, z: x,
        loose=2.0,
        sentence=lambda n: (
            f"when a log begins {n.place} rubs with {n('more_Nm', 'N m')} {n.either('more_Nm', 'more', 'less')} "
            f"(Coulomb) and {n(WARM, 'N m s/rad')} {n.either(WARM, 'more', 'less')} (viscous) than later"
            f"{n.also(', fading over {}', 'over_s', 's')}"
        ),
        separate="Repeat the same motion until the joint is warm.",
    ),
    JointCause(
        "spring", "spring at {joint}", ("stiffness_Nm_per_rad", "offset_Nm"),
        lambda s, h: (s.q - s.span.middle, np.ones_like(s.q)), lambda z, h: (2.0 * z.torque / z.travel, z.torque),
        sentence=lambda n: (
            f"a spring of {n(STIFFNESS, 'N m/rad')} {n.either(STIFFNESS, 'pulls', 'pushes')} {n.place} "
            f"{n.either(STIFFNESS, 'back to', 'away from')} {_neutral(n)}"
        ),
        separate="Move slowly over the whole range.",
    ),
    JointCause(
        "counterbalance", "counterbalance of {joint}", ("cosine_Nm", "sine_Nm"),
        lambda s, h: (np.cos(s.q), np.sin(s.q)), lambda z, h: (z.torque, z.torque),
        sentence=lambda n: (
            f"a torque on {n.place} goes with its angle, {n('cosine_Nm', 'N m', signed=True)} (cosine) and "
            f"{n('sine_Nm', 'N m', signed=True)} (sine)"
        ),
        separate="Move slowly over the whole range.",
    ),
    JointCause(
        "ripple", "torque ripple in {joint}", ("cosine_Nm", "sine_Nm"),
        lambda s, h: (np.cos(h["turns"] * s.q), np.sin(h["turns"] * s.q)), lambda z, h: (z.torque, z.torque),
        ({"turns": 2.0}, {"turns": 3.0}, {"turns": 4.0}, {"turns": 6.0}),
        sentence=lambda n: (
            f"a torque in {n.place} repeats {_again(n)}, with {n('cosine_Nm', 'N m', signed=True)} (cosine) and "
            f"{n('sine_Nm', 'N m', signed=True)} (sine)"
        ),
        separate="Pass the same way at several speeds: what depends on the place stays there.",
    ),
)  # fmt: skip
"""Causes at one joint."""
AXES = ("xx", "yy", "zz", "xy", "xz", "yz")
POINT = ("x_m", "y_m", "z_m")
OTHERS = (
    OtherCause(
        "joint_zero", "zero of {joint}", ("zero_rad",),
        lambda n: (
            f"{n.place} stands {n('zero_rad', 'mrad', 1e3)} {n.either('zero_rad', 'farther', 'less far')} than it reads"
        ),
        "Compare with a mark, or an inclinometer on the link.",
    ),
    OtherCause(
        "link_length", "seat of {joint} on the link before it", POINT,
        lambda n: f"{n.place} sits off by {n.point('mm', 1e3)} on the link before it",
        "Measure it with a gauge.",
    ),
    OtherCause(
        "coupled_drive", "coupled drive of {pair}", ("coulomb_Nm", VISCOUS, "armature_kgm2"),
        lambda n: (
            f"a motor turns with the {'difference' if n.value('ratio') < 0.0 else 'sum'} of {n.place}: it rubs with "
            f"{n('coulomb_Nm', 'N m', signed=True)} (Coulomb) and {n(VISCOUS, 'N m s/rad', signed=True)} (viscous), "
            f"and its rotor adds {n('armature_kgm2', 'kg m^2', signed=True)}"
        ),
        "Move one of the two joints alone.",
    ),
    OtherCause(
        "elasticity", "elasticity of {joint}", ("compliance_rad_per_Nm",),
        lambda n: f"{n.place} yields by {n('compliance_rad_per_Nm', 'mrad per N m', 1e3)} behind its encoder",
        "Hold the motor, load the link with a known torque, and read a dial gauge.",
    ),
    OtherCause(
        "backlash", "backlash of {joint}", ("width_rad",),
        lambda n: f"the gear of {n.place} has a play of {n('width_rad', 'mrad', 1e3)}{_read_at(n)}",
        "Hold the motor and turn the link back and forth by hand.",
    ),
    OtherCause(
        "soft_stand", "stand that yields",
        tuple(
            f"{what}_{axis}_{unit}"
            for what, units in (("stiffness", ("N_per_m", "Nm_per_rad")), ("damping", ("Ns_per_m", "Nms_per_rad")))
            for unit in units
            for axis in "xyz"
        ),
        lambda n: (
            f"the base stands on springs: {_springs(n, 'N_per_m')} N/m along x, y and z, and "
            f"{_springs(n, 'Nm_per_rad')} N m/rad about them"
        ),
        "Push the base by hand, or fix it to the ground, and repeat the motion.",
    ),
    OtherCause(
        "back_emf", "back-EMF in {joint}", ("braking_Nms_per_rad",),
        lambda n: (
            f"the motor of {n.place} loses {n('braking_Nms_per_rad', 'N m s/rad')} to its speed while its drive is on"
        ),
        "Repeat the motion with the drive off, such as a fall.",
    ),
    OtherCause(
        "gravity_direction", "tilt of the base", ("tilt_1_rad", "tilt_2_rad"),
        lambda n: (
            f"the base is turned{_as_on(n.value('turned_deg'))}: gravity points along {n.point('m/s^2', 1.0)} of the "
            "base, not where the model has it"
            if n.value("turned_deg")
            else f"the base is tilted by {n('tilt_1_rad', 'mrad', 1e3, signed=True)} and "
            f"{n('tilt_2_rad', 'mrad', 1e3, signed=True)} about the two horizontal axes"
        ),
        "Put a level on the base.",
    ),
    OtherCause(
        "gravity_compensation", "missing gravity compensation", ("share",),
        lambda n: f"{n('share', '%', 100.0, signed=True)} of gravity's torque is missing in the log",
        "Read the torques at rest in several poses.",
    ),
    OtherCause(
        "link_mass", "mass of {link}", ("excess_kg",),
        lambda n: (
            f"{n.place} has {n('excess_kg', 'kg')} {n.either('excess_kg', 'more', 'less')} {n.than}"
            + (f", and its centre of mass is off by {n.point('mm', 1e3)}" if "x_m" in n.values else "")
        ),
        "Weigh the link; or use a known weight, if torques may be off in scale.",
    ),
    OtherCause(
        "link_com", "centre of mass of {link}", POINT,
        lambda n: f"the centre of mass of {n.place} is off by {n.point('mm', 1e3)}",
        "Balance the link on an edge.",
    ),
    OtherCause(
        "link_inertia", "inertia of {link}", ("share",),
        lambda n: (
            f"the inertia of {n.place} is {n('share', '%', 100.0)} {n.either('share', 'larger', 'smaller')} {n.than}"
        ),
        "Swing the link as a pendulum.",
    ),
    OtherCause(
        "payload", "payload at {link}", ("mass_kg", *POINT, *(f"inertia_{axes}_kgm2" for axes in AXES)),
        lambda n: (
            f"{n.place} carries {n('mass_kg', 'kg')} {n.either('mass_kg', 'more', 'less')} {n.than}, centred at "
            f"{n.point('mm', 1e3)} of its frame"
        ),
        "Repeat the motion without it.",
    ),
    OtherCause(
        "push", "push on the last link", ("x_N", "y_N", "z_N"),
        lambda n: (
            f"something pushed the last link with {n.point('N', 1.0)}{n.also(' from {} on', 'start_s', 's')}"
            f"{n.also(' for {}', 'duration_s', 's')}"
        ),
        "Repeat the motion: a push does not repeat.",
    ),
    OtherCause(
        "unlisted", "something unlisted at {joint}", (),
        lambda n: f"something that no table lists acts at {n.place}",
        "Move this joint alone, at several speeds, in several poses and under several loads.",
    ),
)  # fmt: skip
"""Causes at a link, at two joints or on the whole robot, and the unlisted cause."""
WORDS: dict[str, JointCause | OtherCause] = {cause.name: cause for cause in (*CAUSES, *OTHERS)}
"""Every cause by its name."""
LINKS = frozenset(cause.name for cause in OTHERS if "{link}" in cause.title)
"""Causes at a link; a link may have the same name as a joint."""
