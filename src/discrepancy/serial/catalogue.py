"""The catalogue as candidates, and what all of it together leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.base import Cause, Hints, partner
from discrepancy.serial.mechanics.tree import Tree
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rows.signals import Signals
from discrepancy.serial.servo.motor import Motor, driven_by_voltage
from estimator.arrays import Array

Tolerances = Mapping[str, Mapping[str, float]]


def places(cause: Cause, tree: Tree, hints: Hints, *, change: bool = False) -> list[int]:
    """Joints (from 0) at which a cause may sit, or, where it is a change between two days, may have come; -1: the arm.

    A link is as heavy as it was; what has changed is what it carries.
    """
    if change and cause.built:
        return []
    if cause.part == "arm":
        return [-1]
    joints = range(len(tree.joint_body))
    if cause.part == "link":
        # A body of several joints is moved by the last of them.
        moving = [j for j in joints if tree.joint_body[j] not in tree.joint_body[j + 1 :]]
        if cause.name == "payload":
            # Where one joint moves a link its mass does not show: what does is a first moment and an inertia.
            carried = [j for j in moving if tree.moved[:, tree.joint_body[j]].sum() > 1]
            return [j for j in carried if change or j == tree.last_link]
        return [j for j in moving if cause.name == "link_length" or tree.mass[tree.joint_body[j]] > 0]
    travelled = [j for j in joints if hints.travel[j] > rules.LEAST_TRAVEL and cause.shapes(hints, j)]
    if cause.part == "pair":
        return [j for j in travelled if (before := partner(tree, j)) is not None and _alike(tree, j, before)]
    return travelled


def candidates(
    tree: Tree,
    names: Sequence[str],
    hints: Hints,
    excluded: frozenset[str],
    tolerances: Tolerances,
    *,
    change: bool = False,
) -> list[SerialCandidate]:
    """Every lasting cause at every place, in its first shape; of what has changed between two days, or is wrong.

    What is excluded is never named, but stays as far off as is normal: a robot does not know what it may be blamed for.
    """
    out = []
    for name, cause in CAUSES.items():
        if cause.transient:
            continue
        where = places(cause, tree, hints, change=change)
        for at in where:
            given = tolerances.get(name)
            if name == "torque_scale" and given is None and hints.unscaled[at]:
                given = {"scale": rules.UNKNOWN_SCALE_SHARE}
            candidate = cause.at(tree, names, at, cause.shapes(hints, at)[0], given)
            if cause.alike:
                candidate = replace(candidate, among=cause.alike * len(where))
            if name not in excluded:
                out.append(candidate)
            elif all(p.tolerance > 0 for p in candidate.parameters):
                out.append(replace(candidate, hidden=True))
    return out


def events() -> dict[str, dict[str, float]]:
    """Tolerances of what differs between two days: none."""
    return {name: dict.fromkeys(cause.parameters, 0.0) for name, cause in CAUSES.items()}


def hints_of(parts: Sequence[Signals], logs: Sequence[JointLog], motors: Sequence[Motor] = ()) -> Hints:
    """Hints from all logs of one robot, and from those of its drives that tell no torque."""
    typical = parts[0].typical
    load = np.sqrt(np.mean(np.concatenate([s.inverse for s in parts]) ** 2, axis=0))
    q = np.concatenate([s.q for s in parts])
    tree = parts[0].tree
    turns, cutoff = [], min(s.cutoff_hz for s in parts)
    for j in range(q.shape[1]):
        each = {n * g for n in rules.RIPPLE_TURNS for g in {1.0, abs(float(logs[0].drive.gear[j]))}}
        turns.append([] if tree.slides[j] else [t for t in sorted(each) if _passes(t, typical[j], cutoff)])
    return Hints(
        typical,
        np.max([s.slow for s in parts], axis=0),
        load,
        np.ptp(q, axis=0),
        0.5 * (q.max(axis=0) + q.min(axis=0)),
        turns,
        _couplings(tree, logs[0]),
        driven_by_voltage(motors, q.shape[1]) & _moves_while_off(parts),
        np.isin(np.arange(q.shape[1]), [motor.joint for motor in motors]),
        max(float(s.time[-1]) for s in parts),
    )


def _alike(tree: Tree, one: int, other: int) -> bool:
    return bool(tree.slides[one] == tree.slides[other])


def _passes(turns: float, typical: float, cutoff: float) -> bool:
    """Whether a ripple of so many periods a turn is slow enough for the rows; one a turn is a counterbalance."""
    return turns > 1.0 and turns * typical / (2.0 * np.pi) < rules.MOST_RIPPLE_HZ * cutoff


def _moves_while_off(parts: Sequence[Signals]) -> NDArray[np.bool_]:
    """Which joints move while the drives are off, too, in some log, shape (J,)."""
    out = np.zeros(parts[0].q.shape[1], dtype=bool)
    for s in parts:
        if s.enabled is not None and not s.enabled.all():
            moves = np.abs(s.dq[~s.enabled]) > rules.MOVING_SHARE * s.typical
            out |= moves.sum(axis=0) > rules.LEAST_OFF_S * s.rate_hz
    return out


def _couplings(tree: Tree, log: JointLog) -> Array:
    """Turns of every joint's motor per turn of the joint before it, over those per turn of its own; NaN if unknown."""
    coupling = log.drive.coupling
    out = np.full(len(tree.joint_body), np.nan)
    if np.any(coupling - np.diag(np.diag(coupling))):
        motor = np.linalg.inv(coupling)  # motor positions from joint positions
        for j in range(len(out)):
            before = partner(tree, j)
            if before is not None and motor[j, j]:
                out[j] = motor[j, before] / motor[j, j]
    return out
