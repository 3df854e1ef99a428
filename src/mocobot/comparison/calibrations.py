"""What two calibrations both give: the robots, and what they carry."""

from collections.abc import Iterator

import numpy as np

from estimator.arm.unit import AT, COUNT, GROUPS, MIXED, in_encoder_frames
from estimator.arrays import Array, inertia_parameters
from estimator.calibrate.calibration import CalibratedPayload, Calibration, carried
from estimator.calibrate.text import SHOWN, shown_groups
from estimator.errors import InputError
from estimator.estimate.inertia import PARAMETERS
from mocobot.comparison.difference import Group
from mocobot.comparison.estimates import XYZ, grasp_groups


def groups_of(a: Calibration, b: Calibration) -> list[Group]:
    """Deviations of every robot that both know with an error, and payloads of the same name.

    The spring scale that all robots share is one error of both where neither has a known weight, for it is of the same
    springs: it leaves a difference as far as both depend on it alike.

    Raises:
        InputError: they are of different numbers of robots.
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


def notes_of(a: Calibration, b: Calibration) -> list[str]:
    """What a reader must know of both."""
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
    """Payloads by label."""
    others = {payload.label: payload for payload in b.payloads}
    for payload in a.payloads:
        if payload.label in others:
            yield payload, others[payload.label]


def _deviations(a: Calibration, b: Calibration, robot: int, kind: str) -> Group | None:
    """One kind of one robot's deviations, in the units that reports use."""
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
    """Mass, first of all, centre of mass, inertia and grasps."""
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
    """Mass, centre of mass and inertia, their covariance with the spring scale held, and their derivative by it."""
    found = carried(payload, 0.0)
    values = np.concatenate([[found.mass_kg], found.p_1c, inertia_parameters(found.inertia)])
    return values, found.covariance, found.by_scale
