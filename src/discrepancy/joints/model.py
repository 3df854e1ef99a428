"""Read a robot model from MJCF or URDF, and reject all but fixed-base trees of hinge and slide joints."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from numpy.typing import NDArray

from discrepancy.joints.locking import Lock, locked, reference
from discrepancy.joints.mechanics import Coupling
from discrepancy.joints.reading import ERRORS, read_spec, sentence
from estimator.arrays import Array
from estimator.errors import InputError

_OTHER = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
_NUMBERS = (
    "body_pos", "body_mass", "body_ipos", "body_inertia", "jnt_axis", "dof_damping", "dof_frictionloss", "eq_data",
)  # fmt: skip
"""Arrays of a compiled model that inverse dynamics needs finite; MuJoCo lets infinite numbers pass."""
_AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


@dataclass(frozen=True, eq=False)
class SerialModel:
    """A robot model with J joints that move on their own.

    Attributes:
        path: the file.
        model: the compiled model; it has further joints if some follow others.
        joints: names of the J joints in the order of qpos, without followers; each has one degree of freedom.
        bodies: name of the body that each joint moves.
        slides: whether a joint is prismatic, shape (J,); the others are revolute.
        lower: lower position limit [rad or m], -inf if there is none, shape (J,).
        upper: upper position limit [rad or m], inf if there is none, shape (J,).
        torque_limit: largest torque of a joint's actuators [N m or N], inf if there is no limit, shape (J,).
        coupling: positions of all joints of ``model`` from those of the J joints.
        notes: sentences on what was read otherwise than the file says.
        source: the model to copy, change and compile.
    """

    path: Path
    model: mujoco.MjModel
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    slides: NDArray[np.bool_]
    lower: Array
    upper: Array
    torque_limit: Array
    coupling: Coupling
    notes: tuple[str, ...]
    source: mujoco.MjSpec


def load_model(path: Path | str, lock: Lock = (), base: str | None = None) -> SerialModel:
    """Read and check the model of a fixed-base tree of hinge and slide joints.

    Args:
        path: MJCF or URDF.
        lock: joints that do not move, each with its position; see ``locking.Lock``.
        base: body whose subtree is the arm; its parent is fixed to the world. None: the whole model.

    Raises:
        InputError: MuJoCo cannot read the file, or the model is of another kind: without joints, or with free or ball
            joints, closed chains, soft bodies or plugins that act on bodies.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        return _load(Path(path), lock, base)


def _load(path: Path, lock: Lock, base: str | None) -> SerialModel:
    read = read_spec(path)
    spec, notes = read.spec, list(read.notes)
    try:
        if lock or base is not None:
            notes += locked(spec, lock, base)
        model = spec.compile()
        notes += _without_holds(spec, model)
        model = spec.compile()
        _check(model)
        coupling = Coupling.of(model)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except ERRORS as error:
        raise InputError(f"{path}: MuJoCo cannot compile what is left of it ({sentence(error)})") from error
    for name, moments in read.exact.items():
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body >= 0:  # MuJoCo fuses bodies that do not move on their own
            model.body_inertia[body] = moments
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        model.opt.gravity[:] = 0.0  # so that no caller needs to check the flag
    own = coupling.own
    follows = [model.joint(k).name for k in range(model.njnt) if k not in own]
    if follows:
        notes.append(f"Joints that follow others are no joints of their own: {', '.join(follows)}.")
    limited, limits = model.jnt_limited.astype(bool), _torque_limits(model)
    return SerialModel(
        path=path,
        model=model,
        joints=tuple(model.joint(j).name for j in own),
        bodies=tuple(model.body(model.jnt_bodyid[j]).name for j in own),
        slides=(model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE))[own],
        lower=np.where(limited, model.jnt_range[:, 0], -np.inf)[own],
        upper=np.where(limited, model.jnt_range[:, 1], np.inf)[own],
        torque_limit=limits[own],
        coupling=coupling,
        notes=tuple(notes),
        source=spec,
    )


def _without_holds(spec: mujoco.MjSpec, model: mujoco.MjModel) -> Iterator[str]:
    """Delete constraints that hold nothing: those inactive, within one rigid body, or to a mocap body."""
    held = []
    for e, equality in reversed(list(enumerate(spec.equalities))):
        pair = _ends(model, e) or ()
        mocap = any(model.body_mocapid[b] >= 0 for b in pair)
        if mocap:
            held += [model.body(b).name for b in pair if model.body_mocapid[b] < 0]
        if mocap or len({int(model.body_weldid[b]) for b in pair}) == 1 or not model.eq_active0[e]:
            spec.delete(equality)
    if held:
        yield f"Constraints to mocap bodies, an aid of simulations, are left out: they hold {', '.join(held)}."


def _ends(model: mujoco.MjModel, e: int) -> tuple[int, int] | None:
    """The two bodies of a connect or weld constraint; None for other constraints."""
    if int(model.eq_type[e]) not in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
        return None
    pair = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
    if model.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:
        pair = int(model.site_bodyid[pair[0]]), int(model.site_bodyid[pair[1]])
    return pair


def _check(model: mujoco.MjModel) -> None:
    """Raise InputError if a model is no fixed-base tree of hinges and slides, and say what to type."""
    if not _moved(model):
        raise InputError(
            "the model has no joints that turn or slide; a diagnosis of joint logs needs a fixed-base tree of them"
        )
    for name in _NUMBERS:
        if not np.isfinite(values := getattr(model, name)).all():
            row = int(np.argwhere(~np.isfinite(values))[0, 0])
            raise InputError(f"{name} of entry {row} is {values[row]}; the model's numbers must be finite")
    for name in (model.joint(j).name for j in range(model.njnt)):
        if not name.isprintable():
            raise InputError(f"joint {name!r:.80} must have a printable name")
    for said in (*_floating(model), *_loops(model)):
        raise InputError(said)
    if model.nflex or (model.body_plugin >= 0).any():
        raise InputError(
            f"the model has flexible bodies or plugins; name a part without them: {_bases(model)}"
        )


def _floating(model: mujoco.MjModel) -> Iterator[str]:
    """Sentences on free and ball joints, with what to type: a floating robot first, then all that is to be locked."""
    others = [j for j in range(model.njnt) if int(model.jnt_type[j]) in _OTHER]
    for j in others:
        body, name = int(model.jnt_bodyid[j]), model.joint(j).name
        if _OTHER[int(model.jnt_type[j])] == "free" and any(_above(model, b, body) for b in _moved(model)):
            yield (
                f"joint {name!r} is a free joint, so {model.body(body).name} floats; if it was held, type "
                f"{_locks(model, [j])}, and if one limb moved alone, name the limb: {_bases(model)}"
            )
    if others:
        first = model.joint(others[0]).name, _OTHER[int(model.jnt_type[others[0]])]
        yield f"joint {first[0]!r} is a {first[1]} joint; lock all such joints as modelled: {_locks(model, others)}"


def _locks(model: mujoco.MjModel, joints: list[int]) -> str:
    """Options that lock joints in the reference pose, or as near as their ranges allow."""
    ends = [model.jnt_range[j] if model.jnt_limited[j] else (-np.inf, np.inf) for j in joints]
    names = [model.joint(j).name for j in joints]
    rest = [min(max(reference(model, n), low), high) for n, (low, high) in zip(names, ends, strict=True)]
    return " ".join(f"--lock {shlex.quote(f'{n}={x:.9g}')}" for n, x in zip(names, rest, strict=True))


def _moved(model: mujoco.MjModel) -> list[int]:
    """Bodies with hinges or slides."""
    return [int(model.jnt_bodyid[j]) for j in range(model.njnt) if int(model.jnt_type[j]) not in _OTHER]


def _above(model: mujoco.MjModel, body: int, other: int) -> bool:
    """Whether a body is another or descends from it."""
    while body != other and body:
        body = int(model.body_parentid[body])
    return body == other


def _bases(model: mujoco.MjModel) -> str:
    """Option that names a base: a first moving body below what floats or is fixed; those with most joints first."""
    moved = _moved(model)
    tops = {b for b in moved if not any(b != a and _above(model, b, a) for a in moved)}
    ranked = sorted(tops, key=lambda top: (-sum(_above(model, b, top) for b in moved), top))
    first, *others = (model.body(b).name for b in ranked[:6])  # the reader needs no more
    return f"--base {shlex.quote(first)}" + (f" (or {', '.join(others)})" if others else "")


def _loops(model: mujoco.MjModel) -> Iterator[str]:
    """A sentence on constraints that joints cannot be read with, and what to type; nothing if there are none."""
    found: list[tuple[str, list[int]]] = []
    for e in range(model.neq):
        kind, pair = model.eq_type[e], _ends(model, e)
        one, two = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            if model.eq_data[e, 2:5].any():
                what = "follows another by a polynomial, of which only a constant and a ratio are read"
                found.append((f"joint {model.joint(one).name!r} {what}", [two if two >= 0 else one]))
        elif pair is not None:
            a, b = (model.body(k).name for k in pair)
            sides = [[_above(model, k, int(body)) for body in model.jnt_bodyid] for k in pair]
            loop = np.flatnonzero(sides[0] != np.array(sides[1])).tolist()
            found.append((f"an equality constraint closes a chain between {a} and {b}", loop))
        elif kind == mujoco.mjtEq.mjEQ_TENDON:
            first, joint = model.tendon_adr, int(mujoco.mjtWrap.mjWRAP_JOINT)
            wraps = [w for t in (one, two) if t >= 0 for w in range(first[t], first[t] + model.tendon_num[t])]
            ends = [int(model.wrap_objid[w]) for w in wraps if model.wrap_type[w] == joint]
            found.append(("an equality constraint couples tendons", ends))
        else:
            found.append(("an equality constraint holds a flexible body", []))
    led = {int(model.eq_obj1id[e]) for e in range(model.neq) if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT}
    joints = [j for j in dict.fromkeys(j for _, each in found for j in each) if j not in led]
    if found:
        if set(range(model.njnt)) <= {*joints, *led}:
            yield f"{found[0][0]}, and all joints are part of such chains; only trees of joints can be diagnosed"
        name = f"lock these joints where they stood, for example {_locks(model, joints)}"
        yield f"{found[0][0]}; {name if joints else f'name a part without it: {_bases(model)}'}"


def _torque_limits(model: mujoco.MjModel) -> Array:
    """Torque limit of each joint: its own actuator force range, or the sum of its actuators' force ranges."""
    limits = np.where(model.jnt_actfrclimited.astype(bool), np.abs(model.jnt_actfrcrange).max(axis=1), np.inf)
    at_joint = np.isin(model.actuator_trntype, _AT_JOINT)
    for joint in range(model.njnt):
        own = np.flatnonzero(at_joint & (model.actuator_trnid[:, 0] == joint))
        if len(own) and model.actuator_forcelimited[own].all():
            most = np.abs(model.actuator_forcerange[own]).max(axis=1) * np.abs(model.actuator_gear[own, 0])
            limits[joint] = min(limits[joint], float(most.sum()))
    return limits
