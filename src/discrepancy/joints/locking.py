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


def locked(spec: mujoco.MjSpec, lock: Lock, base: str | None) -> Iterable[str]:
    """Lock joints and cut off all but a subtree; yield sentences on what was done.

    Args:
        spec: a model that compiles; changed.
        lock: joints to remove, with the position in which they stay.
        base: name of the body whose subtree remains; None: all. Joints above it are locked in the reference pose.

    Raises:
        InputError: a joint or body does not exist, or a value is none or out of the joint's range.
    """
    entries = [f"{name}={value}" for name, value in lock.items()] if isinstance(lock, Mapping) else list(lock)
    for entry in (entry for entry in entries if not entry.rpartition("=")[0]):
        raise InputError(f"lock is {entry!r:.80}; it must be JOINT=VALUE, such as wrist=0.5 or wrist=30deg")
    given = {name: text for name, _, text in (entry.rpartition("=") for entry in entries)}
    model = spec.compile()
    check_known(given, [joint.name for joint in spec.joints], "lock", "joint")
    values = {name: _position(model, name, text) for name, text in given.items()}
    if entries:
        yield f"Joints are locked: {', '.join(entries)}."
    if base is not None:
        check_known([base], [body.name for body in spec.bodies[1:]], "base", "body name")
        chain = [spec.body(base)]
        while chain[-1].parent.name != "world":
            chain.append(chain[-1].parent)
        above = [joint for body in chain[1:] for joint in body.joints]
        above += [joint for joint in chain[0].joints if int(joint.type) not in (HINGE, SLIDE)]
        values = {joint.name: reference(model, joint.name) for joint in above} | values
        looking = [element for element in (*spec.cameras, *spec.lights) if element.targetbody]
        beside = zip([*chain[1:], spec.worldbody], chain, strict=True)
        others = [child for body, kept in beside for child in body.bodies if child.name != kept.name]
        for element in (*others, *looking, *spec.skins):
            spec.delete(element)
        yield f"The arm is what body {base} carries; all else stands still in the model's reference pose."
    _with_followers(model, values)
    for body in spec.bodies[1:]:
        _move(model, body, values)
    _remove(spec, {joint.name for joint in spec.joints} & values.keys())


def _position(model: mujoco.MjModel, name: str, text: str) -> float:
    """Position at which a joint is locked [rad or m]; 0 for the reference pose of a free or ball joint."""
    match, joint = _VALUE.fullmatch(text), model.joint(name)
    kind, number = int(joint.type[0]), float(match[1]) if match else math.nan
    what, units = {
        HINGE: ("a number in rad, or in degrees such as 30deg", ("", "deg", "rad")),
        SLIDE: ("a number in m", ("", "m")),
    }.get(kind, ("0, which leaves a free or ball joint as it is modelled", ("",)))
    if (
        not math.isfinite(number)
        or match is None
        or match[2] not in units
        or (number and kind not in (HINGE, SLIDE))
    ):
        raise InputError(f"lock of {name} is {text!r:.40}; it must be {what}")
    value = math.radians(number) if match[2] == "deg" else number
    low, high = joint.range if joint.limited[0] else (-math.inf, math.inf)
    if not low - 1e-6 <= value <= high + 1e-6:  # texts have few digits
        ends = f"{low:.4g} to {high:.4g} {'m' if kind == SLIDE else 'rad'}"
        raise InputError(f"lock of {name} is {text!r:.40}; its range in the model is {ends}")
    return value


def reference(model: mujoco.MjModel, name: str) -> float:
    """Position of a hinge or slide in the reference pose [rad or m]; 0 for others."""
    return float(model.joint(name).qpos0[0]) if int(model.joint(name).type[0]) in (HINGE, SLIDE) else 0.0


def _move(model: mujoco.MjModel, body: mujoco.MjsBody, values: Mapping[str, float]) -> None:
    """Turn and shift a body in its parent by what its locked joints do; the axes of its other joints stay in place."""
    position, rotation = np.zeros(3), Rotation.identity()
    for joint in reversed(list(body.joints)):
        at = model.joint(joint.name)
        axis, anchor, kind = np.array(at.axis), np.array(at.pos), int(at.type[0])
        if joint.name in values and kind in (HINGE, SLIDE):
            way = (values[joint.name] - float(at.qpos0[0])) * axis
            turn = Rotation.from_rotvec(way if kind == HINGE else np.zeros(3))
            shift = way if kind == SLIDE else anchor - turn.apply(anchor)
            position, rotation = shift + turn.apply(position), turn * rotation
        elif (
            position.any() or rotation.magnitude()
        ):  # the pose has what comes after this joint, so move it back
            joint.axis, joint.pos = rotation.inv().apply(axis), rotation.inv().apply(anchor - position)
    if position.any() or rotation.magnitude():
        of, quat = body.compiler, np.array(body.quat)
        if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
            quat = mujoco.MjSpec.resolve_orientation(
                degree=of.degree, sequence=of.eulerseq, orientation=body.alt
            )
        own = Rotation.from_quat(np.array(quat), scalar_first=True)
        body.pos, body.quat = (
            np.array(body.pos) + own.apply(position),
            (own * rotation).as_quat(scalar_first=True),
        )
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _with_followers(model: mujoco.MjModel, values: dict[str, float]) -> None:
    """Add the joints that follow locked ones, with the positions that their equality constraints ask for."""
    joint = int(mujoco.mjtEq.mjEQ_JOINT)
    each = np.flatnonzero((model.eq_type == joint) & model.eq_active0.astype(bool) & (model.eq_obj2id >= 0))
    for e in np.tile(each, len(each)):  # a follower may lead another
        follower, leader = model.joint(model.eq_obj1id[e]).name, model.joint(model.eq_obj2id[e]).name
        if leader in values and follower not in values:
            way = values[leader] - reference(model, leader)
            bent = np.polynomial.polynomial.polyval(way, model.eq_data[e, :5])
            values[follower] = reference(model, follower) + float(bent)
        elif follower in values and leader not in values:
            raise InputError(f"lock names {follower}, which follows {leader}; lock {leader} in its place")


def _remove(spec: mujoco.MjSpec, joints: set[str]) -> None:
    """Delete joints, all that refers to them, and keyframes, which no longer fit."""
    of, trn, eq = mujoco.mjtObj, mujoco.mjtTrn, mujoco.mjtEq
    a_joint, a_tendon, wraps = of.mjOBJ_JOINT, of.mjOBJ_TENDON, mujoco.mjtWrap.mjWRAP_JOINT
    at = {trn.mjTRN_JOINT: a_joint, trn.mjTRN_JOINTINPARENT: a_joint, trn.mjTRN_TENDON: a_tendon}
    of_eq = {eq.mjEQ_JOINT: a_joint, eq.mjEQ_TENDON: a_tendon}
    gone: set[tuple[Any, str]] = {(a_joint, name) for name in joints}
    for elements, kind, refers in (
        (spec.tendons, a_tendon, lambda e: [(a_joint, w.target.name) for w in e.path if w.type == wraps]),
        (spec.equalities, None, lambda e: [(of_eq.get(e.type), name) for name in (e.name1, e.name2)]),
        (spec.actuators, of.mjOBJ_ACTUATOR, lambda e: [(at.get(e.trntype), e.target)]),
        (spec.sensors, None, lambda e: [(e.objtype, e.objname)]),
    ):
        for element in list(elements):
            if not gone.isdisjoint(refers(element)):
                gone.add((kind, element.name))
                spec.delete(element)
    for element in (*(joint for joint in spec.joints if joint.name in joints), *spec.keys):
        spec.delete(element)
