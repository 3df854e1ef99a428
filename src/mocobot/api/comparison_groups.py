"""Groups of quantities that two results share, and tests of their differences against their standard errors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import gammaincc

from discrepancy.result.read import VERDICTS, name_of
from estimator import so3
from estimator.arm.unit import AT, COUNT, GROUPS, MIXED, in_encoder_frames
from estimator.arrays import Array, inertia_parameters
from estimator.calibrate.calibration import CalibratedPayload, Calibration, carried
from estimator.calibrate.text import SHOWN, shown_groups
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import PARAMETERS
from estimator.estimate.result import PayloadEstimate
from estimator.two_bodies.result import UNITS, TwoBodies

if TYPE_CHECKING:
    from discrepancy.joints.calibrated import Told

LEVEL = 0.01
"""Probability that two results of the same truth are reported as different. Chosen: one false alarm in a hundred,
divided evenly among the tested groups (Bonferroni)."""
TOGETHER = 0.9
"""Correlation above which two errors are reported as correlated. Chosen: they then share four fifths of the
variance."""
RANK = 1e-10
"""Smallest eigenvalue of a correlation matrix, relative to the largest, that counts as nonzero. Derived: rounding
errors of eigenvalues are about 1e-16 of the largest, and files keep 16 digits; the limit is six orders above."""
EQUAL = 1e-9
"""Relative difference below which two values count as equal. Derived: converting angles and matrices to and from files
takes a dozen operations with rounding errors of 1e-16 each."""


@dataclass(frozen=True, eq=False)
class Group:
    """Numbers of one kind, such as the three components of a centre of mass.

    Attributes:
        name: name of the group.
        unit: unit of all its numbers.
        entries: name of each number, "" for a single one.
        a, b: values in both results, shape (K,).
        a_covariance, b_covariance: error covariances of the values, shape (K, K).
        covariance: error covariance of the difference b - a, in which common errors cancel, shape (K, K).
    """

    name: str
    unit: str
    entries: tuple[str, ...]
    a: Array
    b: Array
    a_covariance: Array
    b_covariance: Array
    covariance: Array

    @classmethod
    def of(
        cls,
        name: str,
        unit: str,
        entries: tuple[str, ...],
        a: tuple[Array, Array],
        b: tuple[Array, Array],
        *,
        common: tuple[Array, Array] | None = None,
    ) -> "Group":
        """Build a group from values and covariances.

        Args:
            name, unit, entries: attributes of the group.
            a, b: values and their error covariance, without the common error.
            common: derivatives of a and b with respect to one common error of unit variance, shape (K,) each.
        """
        no = np.zeros(len(entries))
        by_a, by_b = common or (no, no)
        return cls(
            name,
            unit,
            entries,
            a[0],
            b[0],
            a[1] + np.outer(by_a, by_a),
            b[1] + np.outer(by_b, by_b),
            a[1] + b[1] + np.outer(by_b - by_a, by_b - by_a),
        )

    @property
    def a_se(self) -> Array:
        """Standard errors of a, shape (K,)."""
        return _errors(self.a_covariance)

    @property
    def b_se(self) -> Array:
        """Standard errors of b, shape (K,)."""
        return _errors(self.b_covariance)

    @property
    def difference(self) -> Array:
        """Difference b - a, shape (K,)."""
        return self.b - self.a

    @property
    def se(self) -> Array:
        """Standard errors of the difference, shape (K,)."""
        return _errors(self.covariance)

    @property
    def ratio(self) -> Array:
        """Differences over their standard errors, shape (K,); infinite for a difference without error."""
        same = np.abs(self.difference) <= EQUAL * np.maximum(np.abs(self.a), np.abs(self.b))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(same, 0.0, self.difference / self.se)

    @cached_property
    def _correlation(self) -> tuple[Array, Array]:
        """Eigenvalues and eigenvectors of the correlation matrix of the difference."""
        se = np.where(self.se > 0, self.se, 1.0)
        return np.linalg.eigh(self.covariance / np.outer(se, se))

    @cached_property
    def _known(self) -> NDArray[np.bool_]:
        """Mask of the eigenvectors with a nonzero error, shape (K,)."""
        values = self._correlation[0]
        return values > RANK * max(values[-1], 0.0)

    @property
    def dof(self) -> int:
        """Degrees of freedom of the test: number of eigenvectors with a nonzero error."""
        return int(np.count_nonzero(self._known))

    @property
    def chi2(self) -> float:
        """Squared Mahalanobis distance between a and b; infinite if ``ratio`` is."""
        if not np.isfinite(self.ratio).all():
            return float("inf")
        values, vectors = self._correlation
        ratios = np.where(self.se > 0, self.ratio, 0.0)
        along = vectors[:, self._known].T @ ratios
        return float(np.sum(along**2 / values[self._known]))

    @property
    def p(self) -> float:
        """P-value of the chi-square test that a and b have the same truth."""
        if not self.dof:
            return 1.0 if self.chi2 == 0 else 0.0
        return float(gammaincc(0.5 * self.dof, 0.5 * self.chi2))

    @property
    def together(self) -> list[tuple[str, str, float]]:
        """Pairs of entries whose errors correlate by at least ``TOGETHER``, with the correlation."""
        se = self.se
        return [
            (self.entries[i], self.entries[j], r)
            for i in range(len(se))
            for j in range(i)
            if se[i] > 0 and se[j] > 0 and abs(r := self.covariance[i, j] / (se[i] * se[j])) >= TOGETHER
        ]


def _errors(covariance: Array) -> Array:
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


XYZ = ("x", "y", "z")


def estimate_groups(a: PayloadEstimate, b: PayloadEstimate) -> list[Group]:
    """Group mass, centre of mass, inertia and grasps, as far as both estimates determine them.

    Raises:
        InputError: the estimates differ in their number of robots.
    """
    if a.robots != b.robots:
        raise InputError(
            f"the estimates are of {a.robots} and {b.robots} robots; both must be of the same number"
        )
    groups = []
    if a.mass and b.mass:
        mass = [(np.array([one.mass]), np.array([[one.se**2]])) for one in (a.mass, b.mass)]
        groups.append(Group.of("mass", "kg", ("",), *mass))
    if in_encoder_frames(a.units) != in_encoder_frames(b.units):
        return groups
    if a.p_1c is not None and b.p_1c is not None:
        assert a.p_1c_covariance is not None
        assert b.p_1c_covariance is not None
        com = (a.p_1c, a.p_1c_covariance), (b.p_1c, b.p_1c_covariance)
        groups.append(Group.of("centre of mass", "m", XYZ, *com))
    if a.inertia and b.inertia:
        inertia = [(inertia_parameters(one.inertia), one.covariance) for one in (a.inertia, b.inertia)]
        groups.append(Group.of("inertia", "kg m^2", PARAMETERS, *inertia))
    if a.grasps and b.grasps:
        groups += grasp_groups(a.grasps, b.grasps)
    return groups


def two_body_groups(a: TwoBodies, b: TwoBodies) -> list[Group]:
    """Group the joint's axis, pivot and terms, and both bodies together with the joint where A has its zero.

    Empty if other robots hold the bodies or the joint is of another kind.

    Raises:
        InputError: the estimates differ in their number of robots.
    """
    if a.robots != b.robots:
        raise InputError(
            f"the estimates are of {a.robots} and {b.robots} robots; both must be of the same number"
        )
    if (a.motion, a.halves) != (b.motion, b.halves):
        return []
    N, N_b, axis_b = a.axes[:, 1:], b.axes[:, 1:], b.axes[:, 0]
    sign, turn = np.sign(a.axes[:, 0] @ axis_b), np.rad2deg(N.T @ N_b)
    none, off = np.zeros(2), np.rad2deg(N.T @ so3.cross(a.axes[:, 0], sign * axis_b))
    axes = np.rad2deg(np.rad2deg(a.joint_covariance[:2, :2])), turn @ b.joint_covariance[:2, :2] @ turn.T
    across = "across it, y", "across it, z"
    groups = [Group.of("axis from A's", "deg", across, (none, axes[0]), (off, axes[1]))]
    if a.pivot is not None and b.pivot is not None:
        along = axis_b @ (a.pivot - b.pivot)  # both lines are compared at A's pivot
        by_turn = along * np.column_stack([so3.cross(n, axis_b) for n in N_b.T])
        J = N.T @ np.hstack([by_turn, N_b])
        apart = N.T @ (b.pivot + along * axis_b - a.pivot), J @ b.joint_covariance @ J.T
        groups.append(Group.of("pivot from A's", "m", across, (none, a.joint_covariance[2:, 2:]), apart))
    zero = float(b.joint.coordinates(a.R_0[None], a.p_0[None]).q[0])
    (x, of_x), (y, of_y) = a.whole_at(0.0), b.whole_at(zero)
    parts = ("mass", "kg", ("",), slice(1)), ("centre of mass", "m", XYZ, slice(1, 4))
    for name, unit, entries, at in (*parts, ("inertia", "kg m^2", PARAMETERS, slice(4, None))):
        groups.append(Group.of(name, unit, entries, (x[at], of_x[at, at]), (y[at], of_y[at, at])))
    for term in (term for term in a.law if term in b.law):
        i, j = a.names.index(term), b.names.index(term)
        row = np.zeros(len(b.names))
        row[j] = 1.0
        if term == "offset":  # of a position that counts from A's zero, in the direction of A's axis
            row[j], row[b.names.index("stiffness")] = sign, -sign * zero
        own = a.parameters[[i]], a.covariance[[i]][:, [i]]
        other = np.array([row @ b.parameters]), np.array([[row @ b.covariance @ row]])
        groups.append(Group.of(term, UNITS[a.motion][term], ("",), own, other))
    return groups


def two_body_changes(a: TwoBodies, b: TwoBodies) -> list[str]:
    """Say which joint and which of its terms only one estimate has."""
    said = [
        f"{one.motion} between robots {' | '.join(' '.join(map(str, half)) for half in one.halves)}"
        for one in (a, b)
    ]
    if said[0] != said[1]:
        return [f"The payload is {said[0]} in A, and {said[1]} in B, so their numbers are not comparable."]
    return [
        f"Only {name} has {'friction' if term == 'friction' else f'a term of {term}'} in the joint."
        for name, one, other in (("A", a, b), ("B", b, a)) for term in one.law if term not in (*other.law, "offset")
    ]  # fmt: skip


def two_body_notes(a: TwoBodies, b: TwoBodies) -> list[str]:
    """List caveats about the comparison of two estimates of two bodies, one sentence each."""
    notes = [
        "Grasps and the second body alone are not compared: their errors depend on where each has its joint."
    ]
    return notes + [f"{name} is flagged: {flag}" for name, one in (("A", a), ("B", b)) for flag in one.flags]


def grasp_groups(
    a: GraspEstimate, b: GraspEstimate, prefix: str = "", common: tuple[Array, Array] | None = None
) -> list[Group]:
    """Group rotation and position of every grasp except the first, in {1}.

    Args:
        a, b: grasps of the same number of robots.
        prefix: prefix of the names of the groups.
        common: as for ``Group.of``, for the parameters (d_2, e_2, ...) of ``GraspEstimate``.
    """
    groups = []
    by_a, by_b = common or (np.zeros(len(a.covariance)),) * 2
    for i in range(1, a.robots):
        turn, shift = slice(6 * i - 6, 6 * i - 3), slice(6 * i - 3, 6 * i)
        name, x = f"{prefix}grasp of robot {i + 1}", Rotation.from_matrix(a.R_1i[i]).as_rotvec()
        first = _turned(x, a.covariance[turn, turn], by_a[turn])
        other = _turned(_near(x, b.R_1i[i]), b.covariance[turn, turn], by_b[turn])
        groups.append(
            Group.of(f"{name}, rotation", "deg", XYZ, first[:2], other[:2], common=(first[2], other[2]))
        )
        places = [(one.p_1i[i], one.covariance[shift, shift]) for one in (a, b)]
        groups.append(Group.of(f"{name}, position", "m", XYZ, *places, common=(by_a[shift], by_b[shift])))
    return groups


def _near(x: Array, R: Array) -> Array:
    """Return the rotation vector of R with an angle below 2 pi that is nearer to x [rad], shape (3,)."""
    y = Rotation.from_matrix(R).as_rotvec()
    angle = float(np.linalg.norm(y))
    other = y * (1.0 - 2.0 * np.pi / angle) if angle > 0 else y
    return min((y, other), key=lambda one: float(np.linalg.norm(one - x)))


def _turned(x: Array, covariance: Array, by: Array) -> tuple[Array, Array, Array]:
    """Convert a rotation vector x [rad], the covariance of its left error rotation and a derivative to degrees.

    Args:
        x: rotation vector [rad], shape (3,).
        covariance: covariance of the error rotation in {1} [rad^2], shape (3, 3).
        by: derivative of the error rotation with respect to the common error [rad], shape (3,).
    """
    J = np.rad2deg(np.linalg.inv(so3.left_jacobian(x)))
    return np.rad2deg(x), J @ covariance @ J.T, J @ by


def estimate_notes(a: PayloadEstimate, b: PayloadEstimate) -> list[str]:
    """List caveats about the comparison of two estimates, one sentence each."""
    notes = _one_sided(a, b)
    if in_encoder_frames(a.units) != in_encoder_frames(b.units):
        notes.append(MIXED)
    if a.payload != b.payload:
        notes.append(f"The payloads go by different names: {a.payload or 'none'} and {b.payload or 'none'}.")
    doubtful = [name for name, one in (("A", a), ("B", b)) if one.contradicts]
    if doubtful:
        notes.append(
            f"In {' and '.join(doubtful)} the robots contradict each other beyond noise: standard errors are too small "
            "there, and differences look larger than they are; calibrate the robots first."
        )
    if a.units is not None and b.units is not None and np.array_equal(a.units.x, b.units.x):
        notes.append(
            "Both take the robots from the same calibration: its errors are in both, and differences are better known "
            "than is said."
        )
    elif a.units is not None or b.units is not None:
        notes.append("They take the robots to be different ones, as calibrated or as designed.")
    return notes


def _one_sided(a: PayloadEstimate, b: PayloadEstimate) -> list[str]:
    kinds: Sequence[tuple[str, object, object]] = (
        ("mass", a.mass, b.mass),
        ("centre of mass", a.p_1c, b.p_1c),
        ("inertia", a.inertia, b.inertia),
        ("grasps", a.grasps, b.grasps),
    )
    return [
        f"The {what} is determined by {'A' if there is not None else 'B'} alone."
        for what, there, other in kinds
        if (there is None) != (other is None)
    ]


def calibration_groups(a: Calibration, b: Calibration) -> list[Group]:
    """Group the robots' deviations that both calibrations estimate, and the payloads with equal labels.

    If neither calibration knows a weight, both have the same error of the springs' common scale. This error cancels
    in a difference as far as both results depend on it alike.

    Raises:
        InputError: the calibrations differ in their number of robots.
    """
    if a.robots != b.robots:
        raise InputError(
            f"the calibrations are of {a.robots} and {b.robots} robots; both must be of the same number"
        )
    groups = [
        group
        for robot in range(a.robots)
        for kind in shown_groups(a)
        if (group := _deviations(a, b, robot, kind.name)) is not None
    ]
    for one, other in _pairs(a, b):
        mixed = in_encoder_frames(a.units) != in_encoder_frames(b.units)
        groups += _payload(one, other, a.scale_sd, b.scale_sd)[: 1 if mixed else None]
    return groups


def calibration_notes(a: Calibration, b: Calibration) -> list[str]:
    """List caveats about the comparison of two calibrations, one sentence each."""
    notes = [
        "Both start from an assumption of how far robots are off, and what the recordings say little of stays near it: "
        "such numbers differ by less than their errors."
    ]
    if a.scale_sd and b.scale_sd:
        notes.append(
            "Neither knows a weight: the robots are taken to have the same springs, whose common scale is then one "
            "error of both, and leaves the differences."
        )
    if in_encoder_frames(a.units) != in_encoder_frames(b.units):
        notes.append(MIXED)
    missing = [
        f"payload {one.label or 'without a name'} is in {name} alone"
        for name, here, there in (("A", a, b), ("B", b, a))
        for one in here.payloads
        if one.label not in {other.label for other in there.payloads}
    ]
    return notes + [f"{sentence[0].upper()}{sentence[1:]}." for sentence in missing]


def _pairs(a: Calibration, b: Calibration) -> Iterator[tuple[CalibratedPayload, CalibratedPayload]]:
    """Yield the pairs of payloads with equal labels."""
    others = {payload.label: payload for payload in b.payloads}
    for payload in a.payloads:
        if payload.label in others:
            yield payload, others[payload.label]


def _deviations(a: Calibration, b: Calibration, robot: int, kind: str) -> Group | None:
    """Group one robot's deviations of one kind in the units of reports; None if no entry has errors in both."""
    at = AT[kind]
    known = (a.sd[robot, at] > 0) & (b.sd[robot, at] > 0)
    if not known.any():
        return None
    shown = SHOWN[kind]
    places = robot * COUNT + np.arange(at.start, at.stop)[known]
    entries = next(group.entries for group in GROUPS if group.name == kind)

    def part(one: Calibration) -> tuple[Array, Array]:
        return (
            shown.scale * one.units.x[robot, at][known],
            shown.scale**2 * one.covariance[np.ix_(places, places)],
        )

    common = tuple(shown.scale * one.scale_sd * one.by_scale[robot, at][known] for one in (a, b))
    return Group.of(
        f"robot {robot + 1}, {shown.name}",
        shown.unit,
        tuple(entry for entry, there in zip(entries, known, strict=True) if there),
        part(a),
        part(b),
        common=(common[0], common[1]),
    )


def _payload(a: CalibratedPayload, b: CalibratedPayload, a_scale_sd: float, b_scale_sd: float) -> list[Group]:
    """Group mass, centre of mass, inertia and grasps; the mass must come first."""
    name = f"payload {a.label}, " if a.label else ""
    (x, x_covariance, by_x), (y, y_covariance, by_y) = _about_com(a), _about_com(b)
    groups = []
    for what, unit, entries, at in (
        ("mass", "kg", ("",), slice(0, 1)),
        ("centre of mass", "m", XYZ, slice(1, 4)),
        ("inertia", "kg m^2", PARAMETERS, slice(4, 10)),
    ):
        common = a_scale_sd * by_x[at], b_scale_sd * by_y[at]
        parts = (x[at], x_covariance[at, at]), (y[at], y_covariance[at, at])
        groups.append(Group.of(f"{name}{what}", unit, entries, *parts, common=common))
    by_scale = a_scale_sd * a.by_scale[:-10], b_scale_sd * b.by_scale[:-10]
    return groups + grasp_groups(a.grasps, b.grasps, name, by_scale)


def _about_com(payload: CalibratedPayload) -> tuple[Array, Array, Array]:
    """Return mass, centre of mass and inertia, their covariance at fixed spring scale, and their derivative by it."""
    found = carried(payload, 0.0)
    values = np.concatenate([[found.mass_kg], found.p_1c, inertia_parameters(found.inertia)])
    return values, found.covariance, found.by_scale


def joint_groups(a: "Told", b: "Told") -> list[Group]:
    """Pair what both calibrations of a robot's joints determine: parameters by place and name, combinations by terms.

    Raises:
        InputError: the calibrations are of different robots.
    """
    one, two = ({p.place for p in c.parameters if p.name.startswith(("mass_", "zero_"))} for c in (a, b))
    if one != two:
        only = ", ".join(sorted(one ^ two))
        raise InputError(f"the calibrations are of different robots: only one of them has {only}")
    both = [(x, b.determined[terms]) for terms, x in a.determined.items() if terms in b.determined]
    numbers = [[_value({"value": q[4], "se": q[5]}) for q in pair] for pair in both]
    return [Group.of(x[1], x[2], ("",), *ab) for (x, _), ab in zip(both, numbers, strict=True)]


def joint_notes(a: "Told", b: "Told") -> list[str]:
    """List caveats about the comparison of two calibrations of a robot's joints, one sentence each."""
    notes = ["Errors of one calibration are correlated among each other, which its file does not say."]
    for name, one, other in (("A", a.determined, b.determined), ("B", b.determined, a.determined)):
        if alone := [q[1] for terms, q in one.items() if terms not in other]:
            notes.append(f"{name} alone determines: {'; '.join(alone)}.")
    return notes


Cause = Mapping[str, Any]
Values = Mapping[str, Any]
"""JSON of a diagnosis."""


def diagnosis_groups(a: Values, b: Values) -> list[Group]:
    """Group the fitted parameters of causes that both diagnoses name at the same place."""
    groups, others = [], {_place(place): place for one in b["causes"] for place in _places(one)}
    for cause in (place for one in a["causes"] for place in _places(one)):
        other = others.get(_place(cause))
        if other is None:
            continue
        one, two = cause["parameters"], other["parameters"]
        names = [n for n in one if n in two and one[n]["se"] is not None and two[n]["se"] is not None]
        for name in names:
            groups.append(
                Group.of(f"{name_of(cause)}, {name}", "", ("",), _value(one[name]), _value(two[name]))
            )
    return groups


def diagnosis_changes(a: Values, b: Values) -> list[str]:
    """List a change of verdict and the causes that only one diagnosis names, one sentence each."""
    out = []
    if a["verdict"] != b["verdict"]:
        before, after = (VERDICTS[one["verdict"]].lower() for one in (a, b))
        out.append(f"The verdict was {before} in A and is {after} in B.")
    for name, here, other_name, there in (("A", a, "B", b), ("B", b, "A", a)):
        named = {_place(place) for cause in there["causes"] for place in _places(cause)}
        for cause in here["causes"]:
            places = _places(cause)
            alone = [place for place in places if _place(place) not in named]
            # If the other diagnosis names none of the places, one sentence covers them all.
            for one in [cause] if len(alone) == len(places) else alone:
                numbers = ", ".join([name_of(one), *_numbers(one)])
                out.append(f"Named in {name} alone: {numbers}; {other_name} {_could(one, there)}.")
    return out


def diagnosis_notes(a: Values, b: Values) -> list[str]:
    """List caveats about the comparison of two diagnoses, one sentence each."""
    left = [(name, one["residual"]["chi2_per_n"]) for name, one in (("A", a), ("B", b))]
    notes = [f"Misfit left (chi2/n): {', '.join(f'{value:.3g} in {name}' for name, value in left)}."]
    if a["causes"] or b["causes"]:
        notes.append(
            "Errors of one cause's parameters are correlated among each other, which their files do not say."
        )
    return notes


def _places(cause: Cause) -> list[Cause]:
    """Split a cause with several places into one entry per place."""
    members = cause.get("members", ())
    return [{**cause, **member, "members": ()} for member in members] if len(members) > 1 else [cause]


def _place(cause: Cause) -> tuple[str, int | None, int | None, str]:
    return cause["cause"], cause["robot"], cause["joint"], cause["place"]


def _value(parameter: Mapping[str, float]) -> tuple[Array, Array]:
    return np.array([parameter["value"]]), np.array([[parameter["se"] ** 2]])


def _numbers(cause: Cause) -> list[str]:
    return [
        f"{name} {one['value']:.3g}" + ("" if one["se"] is None else f" +- {one['se']:.2g}")
        for name, one in cause["parameters"].items()
    ]


def _could(cause: Cause, other: Values) -> str:
    """Say whether the other recordings would have shown the cause, by their detection limits."""
    limits: Sequence[Values] = [
        entry
        for entry in other["detection_limits"]
        if _place({"place": cause["place"]} | dict(entry)) == _place(cause)
    ]
    sizes = {
        name: size
        for entry in limits
        for name, size in entry["parameters"].items()
        if size is not None and name in cause["parameters"]
    }
    if not sizes:
        return "does not say whether it could have seen that"
    seen = any(abs(cause["parameters"][name]["value"]) >= size for name, size in sizes.items())
    listed = ", ".join(f"{name} {size:.2g}" for name, size in sizes.items())
    return (
        f"would have noticed {listed}, so it was not there"
        if seen
        else f"would only have noticed {listed}, so it may be there as well"
    )
