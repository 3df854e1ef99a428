"""Take a part of a robot as the arm: joints locked at a value, and the subtree of a body with its parent fixed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.strict import check_known

Lock = Mapping[str, float | str] | Sequence[str]
"""Values by joint [rad or m, or a text such as ``"30deg"``], or texts such as ``"wrist=30deg"``."""
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(deg|rad|m|)\s*")


def pairs_of(lock: Lock) -> dict[str, str]:
    """Joints to lock with their values as text.

    Raises:
        InputError: an entry is no ``JOINT=VALUE``, or names a joint for the second time.
    """
    if isinstance(lock, Mapping):
        return {str(name): str(value) for name, value in lock.items()}
    found: dict[str, str] = {}
    for entry in lock:
        name, equals, value = entry.rpartition("=")
        if not equals or not name:
            raise InputError(
                f"lock is {entry!r:.80}; it must be JOINT=VALUE, such as wrist=0.5 or wrist=30deg"
            )
        if name in found:
            raise InputError(f"lock names joint {name!r:.80} twice")
        found[name] = value
    return found


def locked(spec: mujoco.MjSpec, lock: Lock, base: str | None) -> Iterable[str]:
    """Lock joints and cut off all but a subtree; yield sentences on what was done.

    Args:
        spec: a model that compiles; changed.
        lock: joints to remove, with the position in which they stay.
        base: name of the body whose subtree remains; None: all. Joints above it are locked in the reference pose.

    Raises:
        InputError: a joint or body does not exist, or a value is none or out of the joint's range.
    """
    model, given = spec.compile(), pairs_of(lock)
    joints = {joint.name: joint for joint in spec.joints}
    check_known(given, tuple(joints), "lock", "joint")
    values = {name: _position(model, name, text) for name, text in given.items()}
    if base is not None:
        bodies = {body.name: body for body in spec.bodies[1:]}
        check_known([base], tuple(bodies), "base", "body")
        chain = [bodies[base]]
        while chain[-1].parent.name != "world":
            chain.append(chain[-1].parent)
        above = [joint for body in chain[1:] for joint in body.joints]
        above += [joint for joint in chain[0].joints if int(joint.type) not in (HINGE, SLIDE)]
        values |= {joint.name: _reference(model, joint.name) for joint in above if joint.name not in values}
        for body, kept in zip([*chain[1:], spec.worldbody], chain, strict=True):
            for other in [child for child in body.bodies if child.name != kept.name]:
                spec.delete(other)
        left = {body.name for body in spec.bodies}
        for looking in [*spec.cameras, *spec.lights]:
            if looking.targetbody and looking.targetbody not in left:
                spec.delete(looking)
        for skin in list(spec.skins):
            spec.delete(skin)
    _with_followers(model, values)
    for body in spec.bodies[1:]:
        _move(model, body, {joint.name: values[joint.name] for joint in body.joints if joint.name in values})
    _remove(spec, [joint for joint in spec.joints if joint.name in values])
    for key in list(spec.keys):
        spec.delete(key)
    if given:
        each = (f"{name} at {_shown(model, name, values[name])}" for name in given)
        yield f"Joints are locked: {', '.join(each)}."
    if base is not None:
        yield f"The arm is what body {base} carries; all else stands still in the model's reference pose."


def _position(model: mujoco.MjModel, name: str, text: str) -> float:
    """Position at which a joint is locked [rad or m]; 0 for the reference pose of a free or ball joint."""
    match, kind = _VALUE.fullmatch(text), int(model.joint(name).type[0])
    number = float(match[1]) if match else math.nan
    if kind not in (HINGE, SLIDE):
        if number != 0.0:
            raise InputError(
                f"lock of {name} is {text!r:.40}; a free or ball joint is locked at 0, as it is modelled"
            )
        return 0.0
    units = ("", "deg", "rad") if kind == HINGE else ("", "m")
    if match is None or match[2] not in units or not math.isfinite(number):
        what = "rad, or in degrees such as 30deg" if kind == HINGE else "m"
        raise InputError(f"lock of {name} is {text!r:.40}; it must be a number in {what}")
    value = math.radians(number) if match[2] == "deg" else number
    low, high = model.joint(name).range if model.joint(name).limited[0] else (-math.inf, math.inf)
    slack = 1e-6 * (high - low) if math.isfinite(high - low) else 0.0
    if not low - slack <= value <= high + slack:
        ends = f"{_shown(model, name, low)} to {_shown(model, name, high)}"
        raise InputError(f"lock of {name} is {text!r:.40}; its range in the model is {ends}")
    return value


def _shown(model: mujoco.MjModel, name: str, value: float) -> str:
    kind = int(model.joint(name).type[0])
    if kind not in (HINGE, SLIDE):
        return "its reference pose"
    return f"{value:.4g} {'rad' if kind == HINGE else 'm'}"


def _reference(model: mujoco.MjModel, name: str) -> float:
    """Position of a hinge or slide in the reference pose; 0 for others."""
    joint = model.joint(name)
    return float(joint.qpos0[0]) if int(joint.type[0]) in (HINGE, SLIDE) else 0.0


def _move(model: mujoco.MjModel, body: mujoco.MjsBody, values: Mapping[str, float]) -> None:
    """Turn and shift a body in its parent by what its locked joints do; the axes of its other joints stay in place."""
    position, rotation = np.zeros(3), Rotation.identity()
    for joint in reversed(list(body.joints)):
        at = model.joint(joint.name)
        axis, anchor = np.array(at.axis), np.array(at.pos)
        if (
            joint.name not in values
        ):  # what comes after it in the body is moved, so its axis is to be moved back
            if position.any() or rotation.magnitude():
                joint.axis, joint.pos = rotation.inv().apply(axis), rotation.inv().apply(anchor - position)
            continue
        if int(at.type[0]) not in (HINGE, SLIDE):
            continue
        way = values[joint.name] - float(at.qpos0[0])
        turn = Rotation.from_rotvec(way * axis if at.type[0] == HINGE else np.zeros(3))
        shift = way * axis if at.type[0] == SLIDE else anchor - turn.apply(anchor)
        position, rotation = shift + turn.apply(position), turn * rotation
    if not (position.any() or rotation.magnitude()):
        return
    own = _orientation(body)
    body.pos = np.array(body.pos) + own.apply(position)
    body.quat = (own * rotation).as_quat(scalar_first=True)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _orientation(body: mujoco.MjsBody) -> Rotation:
    """Orientation of a body in its parent or frame, however the file states it."""
    quat = body.quat
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        of = body.compiler
        quat = mujoco.MjSpec.resolve_orientation(degree=of.degree, sequence=of.eulerseq, orientation=body.alt)
    return Rotation.from_quat(np.array(quat), scalar_first=True)


def _with_followers(model: mujoco.MjModel, values: dict[str, float]) -> None:
    """Add the joints that follow locked ones, with the positions that their equality constraints ask for."""
    each = [
        e for e in range(model.neq) if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[e]
    ]
    for _ in each:  # a follower may lead another
        for e in each:
            follower, leader = (
                model.joint(k).name if k >= 0 else "" for k in (model.eq_obj1id[e], model.eq_obj2id[e])
            )
            if leader in values and follower not in values:
                way = values[leader] - _reference(model, leader)
                bent = np.polynomial.polynomial.polyval(way, model.eq_data[e, :5])
                values[follower] = _reference(model, follower) + float(bent)
            elif follower in values and leader and leader not in values:
                raise InputError(f"lock names {follower}, which follows {leader}; lock {leader} in its place")


def _remove(spec: mujoco.MjSpec, joints: Sequence[mujoco.MjsJoint]) -> None:
    """Delete joints and all that refers to them."""
    of, trn, eq = mujoco.mjtObj, mujoco.mjtTrn, mujoco.mjtEq
    at = {
        trn.mjTRN_JOINT: of.mjOBJ_JOINT,
        trn.mjTRN_JOINTINPARENT: of.mjOBJ_JOINT,
        trn.mjTRN_TENDON: of.mjOBJ_TENDON,
    }
    between = {eq.mjEQ_JOINT: of.mjOBJ_JOINT, eq.mjEQ_TENDON: of.mjOBJ_TENDON}
    gone: set[tuple[Any, str]] = {(of.mjOBJ_JOINT, joint.name) for joint in joints}
    wraps = mujoco.mjtWrap.mjWRAP_JOINT
    for elements, kind, refers in (
        (
            spec.tendons,
            of.mjOBJ_TENDON,
            lambda e: [(of.mjOBJ_JOINT, w.target.name) for w in e.path if w.type == wraps],
        ),
        (spec.equalities, None, lambda e: [(between.get(e.type), e.name1), (between.get(e.type), e.name2)]),
        (spec.actuators, of.mjOBJ_ACTUATOR, lambda e: [(at.get(e.trntype), e.target)]),
        (spec.sensors, None, lambda e: [(e.objtype, e.objname)]),
    ):
        for element in list(elements):
            if not gone.isdisjoint(refers(element)):
                gone.add((kind, element.name))
                spec.delete(element)
    for joint in joints:
        spec.delete(joint)
