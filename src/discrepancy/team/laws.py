"""Errors that no listed cause describes: their place in a team, the signal they depend on, and their columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from discrepancy.evidence.posterior import Group
from discrepancy.formulas.formula import Curve, Kind, Piece, formula_of
from discrepancy.formulas.law import Law, Of, traces
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.dynamics import moment_about_axes
from estimator.arm.motion import PHI, PHI_DDOT, PHI_DOT, TAU, THETA, THETA_DDOT, THETA_DOT
from estimator.arrays import Array

XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Variable(Of):
    """A signal that an error may depend on; ``kind`` selects the functions that make sense."""

    kind: Kind


TIME = Variable("time", "time", "t", "s", "time")
"""Time since the start of the trial."""
JOINTS: dict[str, tuple[slice, str, str, str, Kind]] = {
    "phi": (PHI, "angle of driven joint", "phi", "rad", "angle"),
    "phi_rate": (PHI_DOT, "rate of driven joint", "phi'", "rad/s", "other"),
    "phi_acceleration": (PHI_DDOT, "acceleration of driven joint", "phi''", "rad/s^2", "other"),
    "tau": (TAU, "torque of driven joint", "tau", "N m", "other"),
    "theta": (THETA, "angle of gimbal axis", "theta", "rad", "angle"),
    "theta_rate": (THETA_DOT, "rate of gimbal axis", "theta'", "rad/s", "other"),
    "theta_acceleration": (THETA_DDOT, "acceleration of gimbal axis", "theta''", "rad/s^2", "other"),
}
"""Signals of a joint: slots, words, symbol, unit and kind."""
PAYLOAD: dict[str, tuple[str, str, str, Kind]] = {
    "payload_position": ("position of the payload along", "p", "m", "way"),
    "payload_velocity": ("velocity of the payload along", "v", "m/s", "other"),
    "payload_felt": ("acceleration that the payload feels, less gravity, along its", "f", "m/s^2", "other"),
    "payload_acceleration": ("acceleration of the payload along", "a", "m/s^2", "other"),
    "payload_rate": ("turn rate of the payload about its", "omega", "rad/s", "other"),
    "payload_up": ("tilt of the payload, component of up along its", "up", "1", "other"),
}
"""Signals of the payload: words, symbol, unit and kind. Position and velocity are in {b1}, the others in {1}."""


@dataclass(frozen=True)
class Place:
    """A place where an error may act: one error signal, or one per axis.

    Attributes:
        name: kind of error as in the JSON, such as ``tau reading``.
        robot, joint: numbers from 1, or None.
        targets: the simulator's names of the quantities that the components add to, such as ``tau_2_1``.
        axes: names of the components in words; one empty name for a single component.
        units: of each component.
        title: description in words.
        own: signals of the same joint or robot, on which the error most likely depends.
    """

    name: str
    robot: int | None
    joint: int | None
    targets: tuple[str, ...]
    axes: tuple[str, ...]
    units: tuple[str, ...]
    title: str
    own: tuple[Variable, ...] = ()

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Identity of the place."""
        return self.name, self.robot, self.joint


def joint_variable(name: str, robot: int, joint: int) -> Variable:
    """Return a signal of one joint (robot and joint from 1)."""
    _, words, symbol, unit, kind = JOINTS[name]
    said = f"{words} {joint} of robot {robot}"
    return Variable(f"{name}_{robot}_{joint}", said, f"{symbol}_{robot}{joint}", unit, kind)


def payload_variable(name: str, axis: str) -> Variable:
    """Return a signal of the payload along one axis."""
    words, symbol, unit, kind = PAYLOAD[name]
    return Variable(f"{name}_{axis}", f"{words} {axis}", f"{symbol}_{axis}", unit, kind)


def places_of(robots: int) -> list[Place]:
    """List the places of N robots and their payload, in the order of the search."""
    out = []
    for i in range(1, robots + 1):
        for j in (1, 2, 3):
            driven = tuple(joint_variable(name, i, j) for name in JOINTS if not name.startswith("theta"))
            gimbal = tuple(joint_variable(name, i, j) for name in JOINTS if name.startswith("theta"))
            out += [
                Place(name, i, j, (f"{target}_{i}_{j}",), ("",), (unit,), title, own)
                for name, target, unit, title, own in (
                    ("tau reading", "tau", "N m", "reading of the torque sensor of driven joint", driven),
                    ("phi reading", "phi", "rad", "reading of the angle of driven joint", driven),
                    ("theta reading", "theta", "rad", "reading of the angle of gimbal axis", gimbal),
                    ("gimbal torque", "gimbal_torque", "N m", "torque in gimbal axis", gimbal),
                )
            ]
        for what in ("base", "grasp"):
            targets = tuple(f"{what}_position_{i}_{a}" for a in XYZ)
            out.append(
                Place(f"{what} position", i, None, targets, XYZ, ("m",) * 3, f"displacement of {what}")
            )
    outer, inner = list(PAYLOAD)[:2], list(PAYLOAD)[2:]
    own, felt = (tuple(payload_variable(n, a) for n in names for a in XYZ) for names in (outer, inner))
    targets = tuple(f"payload_{kind}_{a}" for kind in ("force", "moment") for a in XYZ)
    axes = tuple(f"{kind} {a}" for kind in ("force", "moment") for a in XYZ)
    moments, spins = (tuple(f"payload_{kind}_{a}" for a in XYZ) for kind in ("first_moment", "spin"))
    return [
        *out,
        Place("force on payload", None, None, targets, axes, ("N",) * 3 + ("N m",) * 3,
              "force and moment on the payload, in the world", own),
        Place("payload mass", None, None, ("payload_mass",), ("",), ("kg",), "mass of the payload"),
        Place("payload centre", None, None, moments, XYZ, ("kg m",) * 3, "first moment of the payload's mass", felt),
        Place("payload spin", None, None, spins, XYZ, ("kg m^2/s",) * 3, "angular momentum inside the payload"),
    ]  # fmt: skip


def signals_of(linear: TrialLinear) -> dict[str, Array]:
    """Values of all signals in one trial, shape (Q,) each."""
    signals, out = linear.signals, {TIME.name: linear.signals.time - linear.signals.time[0]}
    for name, (slots, *_) in JOINTS.items():
        for i in range(linear.robots):
            for j in range(3):
                out[f"{name}_{i + 1}_{j + 1}"] = linear.s[:, i, slots][:, j]
    motion = linear.motion
    position = linear.data.p_bi[:, 0]
    vectors = {
        "payload_position": position,
        "payload_velocity": signals.with_rates(position)[1],
        "payload_acceleration": motion.acceleration,
        "payload_felt": motion.acceleration + linear.data.gravity_mps2 * motion.up,
        "payload_rate": motion.omega,
        "payload_up": motion.up,
    }
    for name, vector in vectors.items():
        for axis, values in zip("xyz", np.asarray(vector).T, strict=True):
            out[f"{name}_{axis}"] = np.ascontiguousarray(values)
    return out


def directions_at(linear: TrialLinear, place: Place) -> Array:
    """Derivative of the residual by an error, its rate and its acceleration, shape (n, components, 3 or 1, C).

    The derivative is taken at the middle of each row, because it changes more slowly than the error.

    Args:
        linear: the trial.
        place: one of ``places_of``.
    """
    at = linear.reduction.sample
    robot, joint = (place.robot or 1) - 1, (place.joint or 1) - 1
    if place.name in ("phi reading", "theta reading"):
        slots = (PHI, PHI_DOT, PHI_DDOT) if place.name == "phi reading" else (THETA, THETA_DOT, THETA_DDOT)
        J = [linear.J.at(robot, kind, at)[..., joint] for kind in slots]
        return np.stack(J, axis=1)[:, None]
    if place.name == "tau reading":
        return linear.J.at(robot, TAU, at)[:, None, None, :, joint]
    if place.name == "gimbal torque":
        moment = moment_about_axes(linear.s[at][:, robot, THETA], np.eye(3)[joint])
        moment = moment @ linear.shared.grasps.R_1i[robot].T
        return _wrench(linear, np.zeros_like(moment), moment)[:, None, None]
    if place.name in ("base position", "grasp position"):
        turned = linear.bases.R[robot] if place.name == "base position" else None
        return np.stack([_moved(linear, robot, axis, turned) for axis in np.eye(3)], axis=1)
    return np.stack(list(_of_payload(linear, place.name)), axis=1)


def _wrench(linear: TrialLinear, force: Array, moment: Array) -> Array:
    """Residual of an external wrench on the payload at the origin of {1}, in {1}: (n, 3) each, to shape (n, C)."""
    out = np.zeros((len(force), linear.channels))
    out[:, -6:-3], out[:, -3:] = -force, -moment
    return out


def _moved(linear: TrialLinear, robot: int, axis: Array, base: Array | None) -> Array:
    """Derivative of the residual by value, rate and acceleration of a grasp frame's displacement in {b1}, (n, 3, C).

    Args:
        linear: the trial.
        robot: index from 0.
        axis: direction in the robot's {b} or in its grasp frame {i}, shape (3,).
        base: orientation of the robot's {b} in {b1}; None if ``axis`` is in {i}.
    """
    at = linear.reduction.sample
    displacement = (
        np.tile(base @ axis, (len(at), 1))
        if base is not None
        else linear.data.R_bi[at][:, 0] @ (linear.shared.grasps.R_1i[robot] @ axis)
    )
    out = np.zeros((len(at), 3, linear.channels))
    for i in range(1, linear.robots):
        sign = 1.0 if robot == 0 else -1.0 if robot == i else 0.0
        out[:, 0, 6 * (i - 1) + 3 : 6 * i] = sign * displacement
    wrist = -displacement @ linear.bases.R[robot]
    by_wrist = linear.by_wrist[robot][at]
    out[:, 1, -6:] = np.einsum("nij,nj->ni", by_wrist[..., :3], wrist)
    out[:, 2, -6:] = np.einsum("nij,nj->ni", by_wrist[..., 3:], wrist)
    return out


def _of_payload(linear: TrialLinear, name: str) -> list[Array]:
    """Derivative of the residual by each component of a payload error, shape (n, 3 or 1, C) each."""
    at = linear.reduction.sample
    motion = linear.motion
    R = linear.data.R_bi[at][:, 0]
    com = linear.shared.pi[1:4] / linear.shared.pi[0]
    none = np.zeros((len(at), 3))
    omega, alpha = motion.omega[at], motion.alpha[at]
    # Acceleration of the origin of {1} minus gravity, in {1}.
    felt = motion.acceleration[at] + linear.data.gravity_mps2 * motion.up[at]
    if name == "force on payload":
        forces = [R[:, k] for k in range(3)]  # unit vector k of {b1}, in {1}
        return [
            *(_wrench(linear, f, _crossed(com, f))[:, None] for f in forces),
            *(_wrench(linear, none, f)[:, None] for f in forces),
        ]
    if name == "payload mass":  # a point mass at the known centre of mass
        needed = felt + _crossed(alpha, com) + _crossed(omega, _crossed(omega, com))
        return [_wrench(linear, -needed, -_crossed(com, needed))[:, None]]
    axes = [np.tile(axis, (len(at), 1)) for axis in np.eye(3)]
    if name == "payload centre":
        # Second derivative of the first moment in the world, and the moment of gravity.
        return [
            np.stack(
                [
                    _wrench(linear, -(_crossed(alpha, e) + _crossed(omega, _crossed(omega, e))), -_crossed(e, felt)),
                    _wrench(linear, -2.0 * _crossed(omega, e), none),
                    _wrench(linear, -e, -_crossed(com, e)),
                ],
                axis=1,
            )
            for e in axes
        ]  # fmt: skip
    # Angular momentum fixed in the payload: its rate of change is omega x h.
    return [_wrench(linear, none, -_crossed(omega, e))[:, None] for e in axes]


def _crossed(a: Array, b: Array) -> Array:
    return np.asarray(np.cross(a, b), dtype=np.float64)


TERMS = 7
"""Number of cosines of a function. The shortest period is about a quarter of the signal's range."""
SIZES = {
    "tau reading": 5e-3, "phi reading": 1e-4, "theta reading": 1e-4, "gimbal torque": 2e-3, "base position": 1e-5,
    "grasp position": 1e-5, "force on payload": 0.02, "payload mass": 0.01, "payload centre": 3e-3,
    "payload spin": 0.01,
}  # fmt: skip
"""Typical small error at each place, in its unit: the tolerance of the listed causes there."""
SLAB = 16.0
"""Prior standard deviation of an unlisted error, in these sizes."""
UNLISTED_NATS = 5.0
"""Log odds of a listed cause against an unlisted law."""
OPEN_NATS = 150.0
"""Log evidence of excess noise that starts the search for unlisted laws. Measured: clean teams reach 110."""
LIKELIEST = 8
"""Number of laws proposed in each step."""
OWN_CONSTANT = ("gimbal torque", "force on payload", "payload spin")
"""Places where no listed cause is a constant."""
HUM_HZ = (0.3, 6.0)
"""Frequency range of a hum [Hz]. A slower one is a function of time; rows come at 12.5 Hz."""


@dataclass(frozen=True, eq=False)
class Unlisted:
    """An error at a place as a function of a signal.

    Attributes:
        place: where the error acts.
        component: index of the place's component.
        variable: the signal that it depends on.
        times: a signal that multiplies the function, or None.
        terms: number of cosines.
        hz: frequency of a hum, or None.
        among: number of equally probable laws.
    """

    place: Place
    component: int
    variable: Variable
    times: Variable | None = None
    terms: int = TERMS
    hz: float | None = None
    among: int = 1

    @property
    def where(self) -> str:
        """The place in words."""
        own = self.place
        where = f"{own.title} {own.joint}" if own.joint else own.title
        where += f" of robot {own.robot}" if own.robot else ""
        return f"{where} {own.axes[self.component]}".strip()

    @property
    def first(self) -> int:
        """Order of the first cosine: 0 if the law needs its own constant, otherwise 1."""
        return 0 if self.place.name in OWN_CONSTANT and self.hz is None else 1

    @property
    def group(self) -> Group:
        """The law as a group of the search, without columns."""
        k = np.append(np.arange(self.first, self.terms + 1.0), 1.0) if self.hz is None else np.zeros(2)
        falling = 1.0 / (1.0 + k)
        sizes = SLAB * SIZES[self.place.name] * falling / np.sqrt(np.sum(falling**2))
        shape = [(self.variable.name, float(self.component))]
        shape += [(f"times {self.times.name}", 1.0)] if self.times else []
        shape += [("terms", float(self.terms))] if self.terms != TERMS else []
        shape += [("hz", self.hz)] if self.hz is not None else []
        odds = -UNLISTED_NATS - math.log(self.among)
        return Group("unlisted", self.where, (), tuple(sizes.tolist()), odds, tuple(shape), late=True)


@dataclass(eq=False)
class Laws:
    """All errors at a team's places that are functions of the team's own signals.

    Attributes:
        linear: the linearised trials.
        laws: by the identity of their groups.
    """

    linear: Sequence[TrialLinear]
    laws: dict[object, Unlisted] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for place in places_of(self.linear[0].robots):
            for component in range(len(place.targets)):
                for variable, times in self._variables(place):
                    law = Unlisted(place, component, variable, times)
                    self.laws[law.group.identity] = law

    def of(self, group: Group) -> Unlisted:
        """Return the law that a group stands for."""
        shape = dict(group.shape)
        plain = tuple(item for item in group.shape if item[0] not in ("terms", "hz"))
        law = self.laws[group.cause, group.place, plain]
        among = len(self._hums[0]) if "hz" in shape else 1
        return replace(law, terms=int(shape.get("terms", TERMS)), hz=shape.get("hz"), among=among)

    def _variables(self, place: Place) -> Iterator[tuple[Variable, Variable | None]]:
        yield from ((v, None) for v in place.own)
        yield TIME, None
        if place.name == "tau reading" and place.robot and place.joint:
            torques = [joint_variable("tau", place.robot, j) for j in (1, 2, 3)]
            yield from ((v, None) for j, v in enumerate(torques) if j + 1 != place.joint)
            yield TIME, torques[place.joint - 1]  # a drifting scale

    @cached_property
    def _signals(self) -> list[dict[str, Array]]:
        return [signals_of(t) for t in self.linear]

    def _split(self, x: Array) -> list[Array]:
        return np.split(x, np.cumsum([len(s[TIME.name]) for s in self._signals])[:-1])

    def signal(self, variable: Variable) -> Array:
        """Values of a signal in all trials, concatenated."""
        return np.concatenate([s[variable.name] for s in self._signals])

    def functions(self, law: Unlisted) -> Array:
        """Basis functions of a law, shape (Q, k): cosines of the signal's rank and the signal itself, or a hum's waves.

        The signal itself adds slope at the ends of the range, where cosines have none: angle errors act through rates.
        """
        x = self.signal(law.variable)
        if law.hz is not None:
            turned = 2.0 * np.pi * law.hz * x
            return np.stack([np.sin(turned), np.cos(turned)], axis=1)
        u = (rankdata(x) - 0.5) / len(x)
        waves = np.cos(np.pi * np.outer(u, np.arange(law.first, law.terms + 1.0)))
        return np.column_stack([waves, (x - x.mean()) / (math.sqrt(2.0) * np.std(x) + 1e-300)])

    def basis(self, law: Unlisted) -> list[Array]:
        """The law's basis functions, shape (Q, k) a trial."""
        f = self.functions(law)
        return self._split(f if law.times is None else f * self.signal(law.times)[:, None])

    def columns(self, law: Unlisted) -> list[Array]:
        """Columns of the law's terms in the residual, shape (n, C, k) a trial."""
        out = []
        for linear, errors in zip(self.linear, self.basis(law), strict=True):
            D = directions_at(linear, law.place)[:, law.component]  # (n, parts, C)
            parts = linear.signals.with_rates(errors)[: D.shape[1]]
            rows = np.stack([linear.reduction(part) for part in parts], axis=1)
            out.append(np.einsum("npc,npk->nck", D, rows))
        return out

    def finer(self, group: Group) -> list[Group]:
        """Refinements of a law: twice the cosines, or a hum at a slightly lower and higher frequency."""
        law = self.of(group)
        if law.hz is None:
            return [replace(law, terms=2 * TERMS).group] if law.terms == TERMS else []
        step = 0.125 / max(float(s[TIME.name][-1]) for s in self._signals)
        return [replace(law, hz=law.hz + d).group for d in (-step, step)]

    def proposed(self, left: Sequence[Array], white: Callable[[list[Array]], list[Array]]) -> list[Group]:
        """Return the most promising laws, judged by the residual along the direction of their place.

        Args:
            left: residual rows over their variance, shape (n, C) a trial.
            white: whitens each row (n, C, 1) by itself.
        """
        directions: dict[tuple[object, int], list[Array]] = {}
        bases: dict[object, list[Array]] = {}
        found = []
        for law in self.laws.values():
            key = law.place.key, law.component
            if key not in directions:
                each = [directions_at(t, law.place)[:, law.component, 0] for t in self.linear]
                directions[key] = white([d[..., None] for d in each])
                found.append(self._hum(law, directions[key], left))
            which = law.variable.name, law.times and law.times.name, law.first
            if which not in bases:
                pairs = zip(self.linear, self.basis(law), strict=True)
                bases[which] = [b[t.reduction.sample] for t, b in pairs]
            slab = np.array(law.group.slab)
            A, b = np.eye(len(slab)), np.zeros(len(slab))
            for D, z, f in zip(directions[key], left, bases[which], strict=True):
                d, g = D[..., 0], (f if law.first == 0 else f - f.mean(axis=0)) * slab
                A += (g * np.sum(d**2, axis=1)[:, None]).T @ g
                b += g.T @ np.sum(d * z, axis=1)
            found.append((0.5 * float(b @ np.linalg.solve(A, b) - np.linalg.slogdet(A)[1]), law))
        best = sorted(found, key=lambda pair: -pair[0])[:LIKELIEST]
        return [law.group for gain, law in best if gain > 0.0]

    @cached_property
    def _hums(self) -> tuple[Array, list[NDArray[np.complex64]]]:
        """Hum frequencies, four per resolvable step, and complex waves at each trial's rows."""
        time = [s[TIME.name][t.reduction.sample] for s, t in zip(self._signals, self.linear, strict=True)]
        hz = np.arange(HUM_HZ[0], HUM_HZ[1], 0.25 / max(float(t[-1]) for t in time))
        return hz, [np.exp(-2j * np.pi * np.outer(hz, t)).astype(np.complex64) for t in time]

    def _hum(
        self, law: Unlisted, directions: Sequence[Array], left: Sequence[Array]
    ) -> tuple[float, Unlisted]:
        """The most promising hum at a place, and its gain after paying for the choice of frequency."""
        hz, waves = self._hums
        score, size = np.zeros(len(hz), dtype=complex), 0.0
        for E, D, z in zip(waves, directions, left, strict=True):
            score += E @ np.sum(D[..., 0] * z, axis=1)
            size += 0.5 * float(np.sum(D**2))
        gain = 0.5 * np.abs(score) ** 2 / max(size, 1e-300)
        best = int(np.argmax(gain))
        own = Unlisted(law.place, law.component, TIME, hz=float(hz[best]), among=len(hz))
        return float(gain[best]) - math.log(own.among) - math.log1p(own.group.slab[0] ** 2 * size), own

    def told(self, group: Group, mean: Array, covariance: Array, prior: Array) -> Law:
        """Summarise a fitted law with its formula.

        Args:
            group: the law, with its columns in the problem.
            mean, covariance: posterior of its terms, shapes (k,) and (k, k).
            prior: prior variances of the fit, shape (k,).
        """
        law = self.of(group)
        place, x, f = law.place, self.signal(law.variable), self.functions(law)
        formula = formula_of(Curve(x, f, mean, covariance, prior, law.variable.kind), law.hz)
        se = np.sqrt(np.maximum(np.einsum("qk,kl,ql->q", f, covariance, f), 0.0))
        w = np.ones(len(x)) if law.times is None else self.signal(law.times)
        time = [s[TIME.name] for s in self._signals]
        own = traces(time, x, w, f @ mean, se, formula, shift=law.first > 0)
        target, unit = (each[law.component] for each in (place.targets, place.units))
        return Law(
            place.name, place.robot, place.joint, target, unit, law.variable, law.times, formula, own
        )  # fmt: skip

    def pieces(self, group: Group, law: Law, mean: Array) -> Iterator[Piece]:
        """Split a law into functions with one amplitude each, as the simulator takes them.

        If the law has no constant of its own, an extra constant removes its mean. Other parameters, such as sensor
        zeros, already include that mean.

        Args:
            group: the law.
            law: its summary.
            mean: values of its terms, as fitted to other data, shape (k,).
        """
        own = self.of(group)
        x = self.signal(own.variable)
        formula = law.formula.through(x, self.functions(own), mean)
        yield from replace(law, formula=formula).pieces()
        if own.first and own.times is None:
            yield {
                "target": law.target,
                "function": "constant",
                "of": TIME.name,
                "amplitude": -float(np.mean(formula.at(x))),
            }
