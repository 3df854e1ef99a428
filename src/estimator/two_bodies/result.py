"""Result of ``estimate_two_bodies``: two bodies on a joint, its JSON and its text report.

``TwoBodies.to_dict`` makes strict JSON with units in the keys; [u] is rad or m, with the joint.

format, version            "mocobot-two-bodies", 1
payload, robots            label or null; N
kind, motion               "hinged", "sliding" or "flexible"; "hinged" or "sliding"
halves                     numbers of the robots that hold body A (robot 1 is of them) and body B
joint                      axis_1 [3], axis_se_deg, pivot_1_m [3] and pivot_se_m (null if sliding)
    covariance             of turns of the axis about y and z [rad] and, with a hinge, shifts of the pivot [m]
    axes_1                 columns (axis, y, z) in {1}, 3 x 3
    zero                   {p_1k_m, R_1k_rotvec_deg}: pose of {k}, the grasp of B's first robot, at q = 0
    q_low, q_high, q_rms   [u]
    terms                  {damping, friction, stiffness, offset: {value, se}} of the joint's force on B,
                           -(damping q_dot + friction sign(q_dot) + stiffness q - offset)
grasps                     list over robots of {robot, p_ki_m, R_ki_rotvec_deg} in the frame of its body, {1} or {k}
parameters                 names, values, covariance: inertial parameters [kg, kg m, kg m^2] that the motion tells, then
                           the terms. A has ten about {1}, with all that the joint hides; B has the others, about the
                           joint frame (axes_1 at q = 0, origin pivot or {k})
whole                      both bodies with the joint at zero: {m_kg, m_se_kg, p_1c_m, p_1c_se_m, I_kgm2, I_se_kgm2}
bodies                     null, or one physically consistent choice of what the joint hides: mass_B_range_kg [2] and A,
                           B: {m_kg, p_c_m, I_kgm2}, A in {1}, B in {1} at q = 0
explained                  list of {motion, halves, log_evidence, noise}, best first
recordings                 list of {name, trial, duration_s, loops_chi2_n, balance_chi2_n, flags}
undetermined               list of {step, direction, vector, reason}
flags, why                 sentences; why the payload was not taken for one rigid body, or ""
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.uncertainty import WeakDirection, numerical_jacobian, standard_errors
from estimator.rigid_team import Bases
from estimator.statistics import measured
from estimator.two_bodies.split import body_of, hidden, pseudo_inertia, split
from estimator.two_bodies.team import NAMES, Joint, Motion, Pair, expand

FORMAT, VERSION = "mocobot-two-bodies", 1


def parameter_names(motion: str) -> tuple[str, ...]:
    """Return the names of the parameters of A (with all that the joint hides) and of B."""
    ten = ("m", "mc_x", "mc_y", "mc_z", "J_xx", "J_xy", "J_xz", "J_yy", "J_yz", "J_zz")
    return (*(f"A.{name}" for name in ten), *(f"B.{name}" for name in NAMES[motion]))


class Explained(NamedTuple):
    """A candidate of ``relative.Candidate`` in brief."""

    motion: str
    halves: tuple[tuple[int, ...], tuple[int, ...]]
    log_evidence: float
    noise: float


@dataclass(frozen=True)
class RecordingFit:
    """chi2 per row of loops and of balance of one recording; about 1 where only noise is left."""

    name: str
    trial: str
    duration_s: float
    loops_chi2_n: float
    balance_chi2_n: float
    flags: tuple[str, ...]


class Body(NamedTuple):
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2], in {1}; B's with the joint at zero."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True)
class TwoBodies:
    """Two bodies on a hinge or slide, in the hands of N robots.

    Attributes:
        kind: "flexible" if the joint has a spring, else ``motion``.
        halves: robots (from 1) of bodies A and B.
        axes: the joint's axis and two normals in {1}, as columns, shape (3, 3).
        joint_covariance: of turns of the axis about its two normals [rad] and, with a hinge, shifts of the pivot along
            them [m], shape (2, 2) or (4, 4).
        pivot: point on a hinge's axis in {1} [m], or None.
        R_0, p_0: pose of {k} in {1} at q = 0; {k} is the grasp frame of the first robot of B.
        R_ki, p_ki: grasps in the frame of their body, shapes (N, 3, 3) and (N, 3).
        law: terms of the joint's force.
        q_low, q_high, q_rms: range and standard deviation of the joint coordinate [rad, m].
        parameters, covariance: what the motion tells; see ``parameter_names``, and the terms of ``law``.
        explained: explanations of the closed loops, best first.
        undetermined: combinations of parameters that the motion does not excite.
        why: reason why the payload was not taken for one rigid body.
    """

    payload: str | None
    robots: int
    kind: str
    motion: Motion
    halves: tuple[tuple[int, ...], tuple[int, ...]]
    axes: Array
    pivot: Array | None
    joint_covariance: Array
    R_0: Array
    p_0: Array
    R_ki: Array
    p_ki: Array
    law: tuple[str, ...]
    q_low: float
    q_high: float
    q_rms: float
    parameters: Array
    covariance: Array
    explained: tuple[Explained, ...]
    recordings: tuple[RecordingFit, ...]
    undetermined: tuple[WeakDirection, ...]
    flags: tuple[str, ...]
    why: str = ""

    @property
    def axis_se_rad(self) -> float:
        """Standard error of the direction of the axis."""
        return float(np.sqrt(np.trace(self.joint_covariance[:2, :2])))

    @property
    def pivot_se_m(self) -> float | None:
        """Standard error of the pivot across the axis; None for a slide."""
        return None if self.pivot is None else float(np.sqrt(np.trace(self.joint_covariance[2:, 2:])))

    @property
    def joint(self) -> Joint:
        """The joint as the equations use it."""
        return Joint(
            self.motion, self.R_0, self.p_0, self.axes, np.zeros(3) if self.pivot is None else self.pivot
        )

    def pair(self, bases: tuple[Bases, ...]) -> Pair:
        """Grasps and joint as the equations use them, with the bases of trials."""
        first, second = (tuple(i - 1 for i in half) for half in self.halves)
        return Pair((first, second), self.R_ki, self.p_ki, self.joint, bases)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of ``parameters``."""
        return (*parameter_names(self.motion), *self.law)

    def value(self, name: str) -> tuple[float, float]:
        """Return a parameter and its standard error, by its name."""
        k = self.names.index(name)
        return float(self.parameters[k]), float(np.sqrt(self.covariance[k, k]))

    def _pseudo(self, parameters: Array) -> tuple[Array, Array]:
        """Return pseudo-inertias of A in {1} and B in {J}, the hidden part with A."""
        n = 10 + len(NAMES[self.motion])
        return pseudo_inertia(parameters[:10]), pseudo_inertia(expand(self.motion) @ parameters[10:n])

    def _at_zero(self, q: float = 0.0) -> Array:
        """Transform from {J} at q to {1}."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.joint.at(q)
        return T

    @property
    def whole(self) -> tuple[Body, Array]:
        """Both bodies with the joint at zero, and standard errors of (m, centre of mass, six moments), shape (10,)."""
        T = self._at_zero()
        P_A, P_B = self._pseudo(self.parameters)
        return Body(*body_of(P_A + T @ P_B @ T.T)), standard_errors(self.whole_at(0.0)[1])

    def whole_at(self, q: float) -> tuple[Array, Array]:
        """Return ``whole_of`` the estimate with the joint at q, and its covariance."""
        J = numerical_jacobian(lambda x: self.whole_of(x, q), self.parameters)
        return self.whole_of(self.parameters, q), J @ self.covariance @ J.T

    def whole_of(self, parameters: Array, q: float = 0.0) -> Array:
        """Return (m, centre of mass, six moments about it) in {1} of parameters in this estimate's frames."""
        P_A, P_B = self._pseudo(parameters)
        T = self._at_zero(q)
        m, c, inertia = body_of(P_A + T @ P_B @ T.T)
        return np.array([m, *c, *inertia_parameters(inertia)])

    @property
    def bodies(self) -> tuple[Body, Body, tuple[float, float]] | None:
        """One physically consistent choice of A and B, and the range of B's mass [kg]; None if there is none."""
        n = 10 + len(NAMES[self.motion])
        found = split(self.joint, self.parameters[:10], expand(self.motion) @ self.parameters[10:n])
        if found is None:
            return None
        T = self._at_zero()
        return Body(*body_of(found[0])), Body(*body_of(T @ found[1] @ T.T)), found[2]

    def true_parameters(self, truth: dict[str, Any]) -> Array:
        """Return the true values of ``parameters`` in this estimate's frames, from the content of a truth file.

        Raises:
            KeyError: the truth is not of two bodies.
        """
        A, B = (_true_pseudo(one) for one in truth["bodies"])
        joint, told = self.joint, truth["joint"]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = joint.frame
        back = np.linalg.inv(T)
        P = back @ B @ back.T
        if self.motion == "hinged":
            J = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
            Z = np.array([[0.5 * (J[1, 1] + J[2, 2]), P[0, 3]], [P[0, 3], P[3, 3]]])
        else:
            Z = P[:3, :3]
        G_A, G_B = hidden(joint)
        ten_A, ten_B = _ten(A + G_A @ Z @ G_A.T), _ten(P - G_B @ Z @ G_B.T)
        values = {key.split("_N")[0]: value for key, value in told.items() if isinstance(value, float)}
        rest = told.get("rest_rad", told.get("rest_m", 0.0))
        q = self._true_zero(truth)
        terms = {
            "damping": values.get("damping", 0.0),
            "friction": 0.0,
            "stiffness": values.get("stiffness", 0.0),
            "offset": values.get("stiffness", 0.0)
            * (np.sign(self.axes[:, 0] @ np.array(told["axis_1"])) * rest + q),
        }
        own = np.linalg.pinv(expand(self.motion)) @ ten_B
        return np.array([*ten_A, *own, *(terms[term] for term in self.law)])

    def _true_zero(self, truth: dict[str, Any]) -> float:
        """Return the coordinate at which the true joint has its zero."""
        zero = truth["grasps"][truth["bodies"][1]["robots"][0] - 1]
        R = Rotation.from_rotvec(zero["R_1i_rotvec_deg"], degrees=True).as_matrix()
        return float(self.joint.coordinates(R[None], np.array([zero["p_1i_m"]])).q[0])

    def true_position(self, truth: dict[str, Any]) -> Array | None:
        """Return the true joint position in every row [rad, m], along this estimate's axis and from its zero."""
        told = truth["joint"]
        q = told.get("position_rad", told.get("position_m"))
        sign = np.sign(self.axes[:, 0] @ np.array(told["axis_1"]))
        return None if q is None else sign * np.array(q) + self._true_zero(truth)

    def to_dict(self) -> dict[str, Any]:
        """Convert to the format documented in this module."""
        whole, se = self.whole
        n = len(self.names) - len(self.law)
        bodies = self.bodies
        return {
            "format": FORMAT,
            "version": VERSION,
            "payload": self.payload,
            "robots": self.robots,
            "kind": self.kind,
            "motion": self.motion,
            "halves": [list(half) for half in self.halves],
            "joint": {
                "axis_1": self.axes[:, 0].tolist(),
                "axis_se_deg": float(np.rad2deg(self.axis_se_rad)),
                "pivot_1_m": None if self.pivot is None else self.pivot.tolist(),
                "pivot_se_m": self.pivot_se_m,
                "covariance": self.joint_covariance.tolist(),
                "axes_1": self.axes.tolist(),
                "zero": {"p_1k_m": self.p_0.tolist(), "R_1k_rotvec_deg": _rotvec_deg(self.R_0)},
                "q_low": self.q_low,
                "q_high": self.q_high,
                "q_rms": self.q_rms,
                "terms": {
                    term: {"value": float(self.parameters[n + k]), "se": float(np.sqrt(self.covariance[n + k, n + k]))}
                    for k, term in enumerate(self.law)
                },
            },
            "grasps": [
                {"robot": i + 1, "p_ki_m": p.tolist(), "R_ki_rotvec_deg": _rotvec_deg(R)}
                for i, (R, p) in enumerate(zip(self.R_ki, self.p_ki, strict=True))
            ],
            "parameters": {
                "names": list(self.names),
                "values": self.parameters.tolist(),
                "covariance": self.covariance.tolist(),
            },
            "whole": {
                "m_kg": whole.mass,
                "m_se_kg": float(se[0]),
                "p_1c_m": whole.com.tolist(),
                "p_1c_se_m": se[1:4].tolist(),
                "I_kgm2": inertia_parameters(whole.inertia).tolist(),
                "I_se_kgm2": se[4:].tolist(),
            },
            "bodies": bodies and {
                "mass_B_range_kg": list(bodies[2]),
                **{
                    name: {"m_kg": one.mass, "p_c_m": one.com.tolist(), "I_kgm2": one.inertia.tolist()}
                    for name, one in zip("AB", bodies[:2], strict=True)
                },
            },
            "explained": [one._asdict() | {"halves": [list(half) for half in one.halves]} for one in self.explained],
            "recordings": [asdict(one) | {"flags": list(one.flags)} for one in self.recordings],
            "undetermined": [{"step": weak.step, **weak.to_dict()} for weak in self.undetermined],
            "flags": list(self.flags),
            "why": self.why,
        }  # fmt: skip

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TwoBodies:
        """Inverse of ``to_dict``.

        Raises:
            InputError: the mapping is not an estimate of two bodies, or has another version.
        """
        if not isinstance(values, dict) or values.get("format") != FORMAT or values.get("version") != VERSION:
            raise InputError(
                f"not an estimate of two bodies: it must have format {FORMAT!r} and version {VERSION}"
            )
        try:
            joint, told, grasps = values["joint"], values["parameters"], values["grasps"]
            zero, pivot = joint["zero"], joint["pivot_1_m"]
            return cls(
                **{key: values[key] for key in ("payload", "robots", "kind", "motion", "why")},
                halves=_halves(values["halves"]),
                axes=np.array(joint["axes_1"]),
                pivot=None if pivot is None else np.array(pivot),
                joint_covariance=np.array(joint["covariance"]),
                R_0=_matrix(zero["R_1k_rotvec_deg"]),
                p_0=np.array(zero["p_1k_m"]),
                R_ki=np.array([_matrix(one["R_ki_rotvec_deg"]) for one in grasps]),
                p_ki=np.array([one["p_ki_m"] for one in grasps]),
                law=tuple(joint["terms"]),
                **{key: joint[key] for key in ("q_low", "q_high", "q_rms")},
                parameters=np.array(told["values"]),
                covariance=np.array(told["covariance"]),
                explained=tuple(
                    Explained(**one | {"halves": _halves(one["halves"])}) for one in values["explained"]
                ),
                recordings=tuple(
                    RecordingFit(**one | {"flags": tuple(one["flags"])}) for one in values["recordings"]
                ),
                undetermined=tuple(
                    WeakDirection(one["step"], one["direction"], tuple(one["vector"]), one["reason"])
                    for one in values["undetermined"]
                ),
                flags=tuple(values["flags"]),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"not a complete estimate of two bodies ({type(error).__name__}: {error})"
            ) from error


def _halves(values: Any) -> tuple[tuple[int, ...], tuple[int, ...]]:
    first, second = values
    return tuple(first), tuple(second)


def _rotvec_deg(R: Array) -> list[float]:
    return np.rad2deg(Rotation.from_matrix(R).as_rotvec()).tolist()


def _matrix(rotvec_deg: list[float]) -> Array:
    return Rotation.from_rotvec(rotvec_deg, degrees=True).as_matrix()


def _ten(P: Array) -> Array:
    """Return the ten parameters of a pseudo-inertia."""
    J = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    return np.array([P[3, 3], *P[:3, 3], *inertia_parameters(J)])


def _true_pseudo(body: dict[str, Any]) -> Array:
    m, c, inertia = body["mass_kg"], np.array(body["p_kc_m"]), np.array(body["inertia_k_kgm2"])
    P = np.zeros((4, 4))
    P[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia + m * np.outer(c, c)
    P[:3, 3] = P[3, :3] = m * c
    P[3, 3] = m
    return P


UNITS = {
    "hinged": {"damping": "N m s/rad", "friction": "N m", "stiffness": "N m/rad", "offset": "N m"},
    "sliding": {"damping": "N s/m", "friction": "N", "stiffness": "N/m", "offset": "N"},
}
ABOUT_AXIS = {
    "hinged": {
        "B.J_xx": ("J about the axis", "kg m^2"),
        "B.mc_y": ("m c_y from it", "kg m"),
        "B.mc_z": ("m c_z from it", "kg m"),
    },
    "sliding": {"B.m": ("m", "kg")},
}  # fmt: skip


def format_two_bodies(found: TwoBodies, truth: dict[str, Any] | None = None) -> str:
    """Format a readable report, answer first; ``truth`` is the content of a truth file."""
    true = None if truth is None else found.true_parameters(truth)
    said = " | ".join(" ".join(map(str, half)) for half in found.halves)
    label = "" if found.payload is None else f" ({found.payload})"
    count = len(found.recordings)
    hinged, turn = found.motion == "hinged", 180.0 / np.pi if found.motion == "hinged" else 1e3
    unit = "deg" if hinged else "mm"
    lines = [
        f"[[Payload{label}: two bodies, {found.kind}]]  robots {said}, {count} recording{'s' * (count > 1)}"
    ]
    lines += [f"    {found.why}"] if found.why else []
    lines += ["[[Joint, in {1}]]"]
    off = _axis_error(found, truth)
    lines.append(
        f"    axis:         {_row(found.axes[:, 0])} +- {np.rad2deg(found.axis_se_rad):.2g} deg{off[0]}"
    )
    if found.pivot is not None and found.pivot_se_m is not None:
        lines.append(f"    through:      {_row(found.pivot)} m +- {1e3 * found.pivot_se_m:.2g} mm{off[1]}")
    lines.append(
        f"    moved:        {turn * found.q_low:.3g} to {turn * found.q_high:.3g} {unit}, {turn * found.q_rms:.3g} rms"
    )

    def line(name: str, key: str, unit: str) -> str:
        k = found.names.index(key)
        return _line(name, *found.value(key), unit, None if true is None else float(true[k]))

    lines += [line(term, term, UNITS[found.motion][term]) for term in found.law]
    if "friction" not in found.law:
        lines.append("    friction:       none seen")
    whole, se = found.whole
    lines += ["[[Both bodies, joint at zero]]"]
    known = None if true is None else found.whole_of(true)
    names = ("m", "p_1c x", "p_1c y", "p_1c z", "Ixx", "Iyy", "Izz")
    values = np.array([whole.mass, *whole.com, *inertia_parameters(whole.inertia)])
    for name, k in zip(names, (0, 1, 2, 3, 4, 7, 9), strict=True):
        shown = "kg" if k == 0 else "m" if k < 4 else "kg m^2"
        lines.append(_line(name, values[k], se[k], shown, None if known is None else float(known[k])))
    lines += ["[[Second body]]"]
    lines += [line(name, key, unit) for key, (name, unit) in ABOUT_AXIS[found.motion].items()]
    bodies = found.bodies
    if bodies is None:
        lines.append("    These values, without their errors, are of no two real bodies.")
    else:
        A, B, (low, high) = bodies
        hides = (
            f"The joint hides how the mass divides: with {low:.2g} to {high:.2g} kg in the second, all moves "
            "alike. One pair:"
            if hinged
            else "The joint hides how the inertia divides. One of the pairs that move alike:"
        )
        lines.append(f"    {hides}")
        for robots, one in zip(found.halves, (A, B), strict=True):
            lines.append(
                f"    held by {' '.join(map(str, robots))}: {one.mass:.4g} kg at {_row(one.com)} m, "
                f"I {_row(np.diag(one.inertia))} kg m^2"
            )
    lines += ["[[Evidence]]"]
    best = found.explained[0]
    for one in found.explained[:4]:
        robots = " | ".join(" ".join(map(str, half)) for half in one.halves)
        lines.append(
            f"    {one.motion} {robots}: log evidence {one.log_evidence - best.log_evidence:.0f}, loops leave "
            f"{one.noise:.3g} times the noise"
        )
    for fit in found.recordings:
        lines.append(
            f"    {fit.name}: {fit.trial}, {fit.duration_s:.1f} s, chi2/n {fit.loops_chi2_n:.2f} in the loops, "
            f"{fit.balance_chi2_n:.2f} in the balance"
        )
    if found.undetermined:
        lines += ["[[Not determined]]"] + [f"    {weak}" for weak in found.undetermined]
    if found.flags:
        lines += ["[[Flags]]"] + [f"    {flag}" for flag in found.flags]
    return "\n".join(lines)


def _axis_error(found: TwoBodies, truth: dict[str, Any] | None) -> tuple[str, str]:
    """Return the errors of axis and pivot in words; empty without a truth."""
    if truth is None:
        return "", ""
    axis = np.array(truth["joint"]["axis_1"])
    off = np.rad2deg(np.arcsin(min(1.0, float(np.linalg.norm(np.cross(axis, found.axes[:, 0]))))))
    if found.pivot is None:
        return f"  (off by {off:.2g})", ""
    apart = np.linalg.norm(np.cross(axis, found.pivot - np.array(truth["joint"]["pivot_1_m"])))
    return f"  (off by {off:.2g})", f"  (off by {1e3 * apart:.2g})"


def _line(name: str, value: float, se: float, unit: str, true: float | None) -> str:
    shown, error = measured(value, se) if 0 < se < np.inf else (f"{value:.6f}", f"{se:.6f}")
    beside = "" if true is None else f"  (true {measured(true, se)[0] if 0 < se < np.inf else f'{true:.6f}'})"
    return f"    {name + ':':<18}{shown:>12} +- {error} {unit}{beside}"


def _row(values: Array) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"
