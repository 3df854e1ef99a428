"""MJCF of a payload, read from a file or generated: frame {1} and a site at every grasp.

A payload is one rigid body ``payload``, or two bodies: ``payload``, which robot 1 holds, and its child ``second`` on
one hinge or slide.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.inputs import printable
from mocobot_sim.model_check import check_model, check_named
from mocobot_sim.scene.models import payload_path, posed
from mocobot_sim.scene.pymjcf import compiled, mjcf

OWN_COMPILER_SETTINGS = ("angle", "autolimits", "eulerseq", "assetdir", "meshdir", "texturedir")
# Top-level elements that a payload's file may have. All others would also affect the robots or act on the payload.
OWN_ELEMENTS = ("asset", "compiler", "default", "statistic", "visual", "worldbody")
GRASP = re.compile(r"grasp([0-9]+)")
SECOND = "second"
"""Name of the second body of a payload of two."""
COLOURS = ([0.55, 0.60, 0.70, 1.0], [0.86, 0.62, 0.30, 1.0])
"""Colours of the drawn bodies of an estimated payload of two."""


@dataclass(frozen=True)
class PayloadJoint:
    """Joint of a payload of two bodies, in the home pose, where its position is zero.

    Attributes:
        slides: whether the joint is a slide; otherwise a hinge.
        axis_1: unit vector of the axis in {1}, shape (3,). The second body moves by +q along or about it.
        pivot_1: point on the axis of a hinge in {1} [m], shape (3,).
        stiffness: stiffness about the position ``rest`` [N m/rad or N/m]; 0 for a free joint.
        damping: viscous damping [N m s/rad or N s/m].
        rest: position at which the spring is relaxed [rad or m].
        second: whether each robot holds the second body, N entries.
        joint: id of the joint in the compiled model.
    """

    slides: bool
    axis_1: Array
    pivot_1: Array
    stiffness: float
    damping: float
    rest: float
    second: tuple[bool, ...]
    joint: int

    def moved(self, p_1i: Array, q: Array) -> Array:
        """Positions of the grasps [m], shape (Q, N, 3), at joint positions [rad or m], shape (Q,).

        They are in the axes of {1} in the home pose, from which each body moves by half of the joint's position.
        """
        moved = np.empty((len(q), len(p_1i), 3))
        for i, p in enumerate(p_1i):
            half = np.outer((0.5 if self.second[i] else -0.5) * q, self.axis_1)
            arm = p - self.pivot_1
            moved[:, i] = p + half if self.slides else self.pivot_1 + Rotation.from_rotvec(half).apply(arm)
        return moved


def payload_joint(model: mujoco.MjModel, prefix: str = "") -> PayloadJoint | None:
    """Read the joint of a payload of two bodies from a compiled payload or team; None for a rigid payload."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{SECOND}")
    if body < 0:
        return None
    data, joint = posed(model), int(model.body_jntadr[body])
    first = model.site(f"{prefix}grasp1").id
    R_1W, dof = data.site_xmat[first].reshape(3, 3).T, model.jnt_dofadr[joint]
    grasps = [f"{prefix}grasp{n + 1}" for n in range(model.nsite)]
    sites = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name) for name in grasps]
    return PayloadJoint(
        slides=bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE),
        axis_1=R_1W @ data.xaxis[joint],
        pivot_1=R_1W @ (data.xanchor[joint] - data.site_xpos[first]),
        stiffness=float(model.jnt_stiffness[joint]),
        damping=float(model.dof_damping[dof]),
        rest=float(model.qpos_spring[model.jnt_qposadr[joint]]),
        second=tuple(bool(model.site_bodyid[site] == body) for site in sites if site >= 0),
        joint=joint,
    )


def load_payload(payload: str | Path) -> mjcf.RootElement:
    """Read the MJCF of a payload, given as the name of a shipped payload or the path of an ``.xml`` file.

    Raises:
        InputError: the file cannot be read, has elements that would affect the robots, or refers to files outside its
            folder.
    """
    path = Path(payload) if Path(payload).suffix == ".xml" else payload_path(str(payload))
    if path.exists():
        check_model(path)
    read = mjcf.from_path  # outside the try: a missing dm-control has its own error
    try:
        root = read(str(path))
    except (OSError, ValueError, AttributeError, KeyError, SyntaxError) as error:
        said = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise InputError(f"{path}: not a readable MJCF ({printable(said)})") from error
    check_named(path, assets=True)
    if root.compiler.angle != "radian":
        # The composed scene has one compiler setting for all parts, so degrees would be read as radians.
        raise InputError(f'{path}: compiler angle is {root.compiler.angle or "degree"}; it must be "radian"')
    own = set(root.compiler.get_attributes()) - set(OWN_COMPILER_SETTINGS)
    if own:
        raise InputError(
            f"{path}: compiler setting {min(own)!r} would act on the robots too; "
            f"the payload may set {', '.join(OWN_COMPILER_SETTINGS)}"
        )
    foreign = [child.tag for child in root.all_children() if child.tag not in OWN_ELEMENTS and _is_set(child)]
    if foreign:
        raise InputError(
            f"{path}: <{foreign[0]}> would act on the whole team; "
            f"the payload may have {', '.join(f'<{tag}>' for tag in OWN_ELEMENTS)}"
        )
    root.model = "payload"
    return root


def _is_set(element: Any) -> bool:
    """Whether an element has any content in the file; PyMJCF also lists elements that the file does not have."""
    return bool(element.get_attributes()) or any(_is_set(child) for child in element.all_children())


def grasp_frames(payload_root: mjcf.RootElement, where: str) -> RigidTransform:
    """Grasp frames X_1i of a payload, N transforms.

    They are read from the compiled payload, so all orientation attributes of MJCF are supported.

    Raises:
        InputError: MuJoCo cannot compile the payload; or it is neither a rigid body ``payload`` with sites ``grasp1``
            to ``graspN``, the first at its origin, nor two such bodies on a joint.
    """
    try:
        model = compiled(payload_root)
    except ValueError as error:
        raise InputError(
            f"{where}: MuJoCo cannot compile the payload ({' '.join(str(error).split())})"
        ) from error
    data = posed(model)
    numbers = sorted(int(n[1]) for i in range(model.nsite) if (n := GRASP.fullmatch(model.site(i).name)))
    if not numbers or numbers != list(range(1, len(numbers) + 1)):
        missing = next(n for n in range(1, len(numbers) + 2) if n not in numbers)
        raise InputError(f"{where}: the payload has no site 'grasp{missing}'; it needs grasp1 .. graspN")
    ids = [model.site(f"grasp{n}").id for n in numbers]
    _check_bodies(model, ids, where)
    if not np.isfinite(data.site_xpos).all():
        raise InputError(f"{where}: the payload has a site whose position is not finite")
    if (
        np.abs(data.site_xpos[ids[0]]).max() > 1e-9
        or np.abs(data.site_xmat[ids[0]] - np.eye(3).ravel()).max() > 1e-9
    ):
        raise InputError(
            f"{where}: site 'grasp1' must be at the origin of body 'payload', and that at the world's"
        )
    X_Wi = RigidTransform.from_components(
        data.site_xpos[ids], Rotation.from_matrix(data.site_xmat[ids].reshape(-1, 3, 3))
    )
    return X_Wi[0].inv() * X_Wi


def _check_bodies(model: mujoco.MjModel, grasps: list[int], where: str) -> None:
    """Check that ``payload``, and ``second`` if it exists, have all the mass; the truth is read from them."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "payload")
    if body < 0:
        raise InputError(f"{where}: the payload has no body 'payload'")
    second = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, SECOND)
    if second < 0 and model.njnt:
        raise InputError(
            f"{where}: the payload has joints, {model.njnt} of them; it must be rigid or have its one joint in a body "
            f"{SECOND!r}"
        )
    bodies = [body] if second < 0 else [body, second]
    if second >= 0:
        _check_joint(model, body, second, grasps, where)
    if model.body_mocapid[body] >= 0 or model.body_gravcomp.any():
        raise InputError(
            f"{where}: the payload must be free to move and have its weight: no mocap, no gravcomp"
        )
    if (model.geom_bodyid == 0).any():
        # Such a geom would be attached to robot 1's flange, and the ground truth would miss its mass.
        raise InputError(f"{where}: a geom stands in the world; all geoms must be in body 'payload'")
    numbers = [*model.body_mass, *model.body_inertia[bodies].ravel(), *model.body_ipos[bodies].ravel()]
    if not np.isfinite(numbers).all():
        raise InputError(f"{where}: the payload's mass, inertia or centre of mass is not finite")
    if not (model.body_mass[bodies] > 0).all() or model.body_mass.sum() != model.body_mass[bodies].sum():
        named = "body 'payload'" if second < 0 else f"bodies 'payload' and {SECOND!r}"
        weights = " and ".join(f"{mass:g} kg" for mass in model.body_mass[bodies])
        raise InputError(
            f"{where}: {named} weighs {weights} of {model.body_mass.sum():g} kg; it must carry all the mass, and some"
        )


def _check_joint(model: mujoco.MjModel, body: int, second: int, grasps: list[int], where: str) -> None:
    """Check that one hinge or slide connects the bodies, and that robots hold both."""
    kinds = [mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE]
    if model.njnt != 1 or model.body_jntnum[second] != 1 or not np.isin(model.jnt_type, kinds).all():
        raise InputError(
            f"{where}: the payload has {model.njnt} joints; a payload of two bodies has one hinge or slide, in body "
            f"{SECOND!r}"
        )
    if model.body_parentid[second] != body:
        raise InputError(f"{where}: body {SECOND!r} is not a child of body 'payload'; it must be")
    if model.site_bodyid[grasps[0]] != body or second not in model.site_bodyid[grasps]:
        raise InputError(
            f"{where}: body 'payload' must have grasp1, and body {SECOND!r} at least one other grasp"
        )


def payload_mjcf(mass_kg: float, p_1c: Array, inertia_1: Array, X_1i: RigidTransform) -> mjcf.RootElement:
    """Generate the MJCF of a payload for ``build_team``.

    Args:
        mass_kg: mass, greater than 0 [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
        inertia_1: symmetric inertia about the centre of mass in the axes of {1} [kg m^2], shape (3, 3).
        X_1i: grasp frames in {1}, N transforms; the first is assumed to be the identity.

    Returns:
        A body ``payload`` at {1} with sites ``grasp1`` .. ``graspN`` and ``com``, and thin bars for display.

    Raises:
        InputError: a number is not finite, or no rigid body has this mass and inertia.
    """
    p_1c, inertia_1 = np.asarray(p_1c, dtype=float), np.asarray(inertia_1, dtype=float)
    if not 0 < mass_kg < np.inf:
        raise InputError(f"payload mass is {mass_kg:g} kg; it must be finite and greater than 0")
    if p_1c.shape != (3,) or not np.isfinite(p_1c).all():
        raise InputError(f"payload centre of mass is {p_1c.tolist()}; it must be three finite numbers")
    _check_inertia(inertia_1)
    if not np.isfinite(X_1i.as_matrix()).all():
        raise InputError("a grasp frame is not finite; every number of it must be")

    root = mjcf.RootElement(model="payload")
    root.compiler.angle = "radian"
    body = root.worldbody.add("body", name="payload")
    xx, yy, zz, xy, xz, yz = (inertia_1[at] for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    body.add("inertial", pos=p_1c, mass=mass_kg, fullinertia=[xx, yy, zz, xy, xz, yz])
    look = {"group": 2, "contype": 0, "conaffinity": 0, "mass": 0.0, "rgba": [0.55, 0.60, 0.70, 1.0]}
    body.add("geom", name="com", type="sphere", pos=p_1c, size=[0.02], **look)
    body.add("site", name="com", pos=p_1c, group=4, size=[0.006])
    for i, X in enumerate(X_1i, start=1):
        at = np.zeros(3) if i == 1 else X.translation
        quat = [1.0, 0.0, 0.0, 0.0] if i == 1 else X.rotation.as_quat(scalar_first=True)
        body.add("site", name=f"grasp{i}", pos=at, quat=quat, group=4, size=[0.006])
        if np.linalg.norm(at - p_1c) > 1e-3:
            body.add("geom", name=f"bar{i}", type="capsule", fromto=[*p_1c, *at], size=[0.01], **look)
    return root


def two_body_mjcf(bodies: Sequence[tuple[float, Array, Array]], joint: PayloadJoint, X_1i: Array) -> str:
    """Generate the MJCF document of a payload of two bodies.

    Args:
        bodies: mass [kg], centre of mass in {1} [m], shape (3,), and inertia about it in the axes of {1} [kg m^2],
            shape (3, 3), of ``payload`` and ``second``, with the joint at zero.
        joint: the joint; its id is ignored.
        X_1i: grasp frames in {1} with the joint at zero, shape (N, 4, 4).
    """
    root = mjcf.RootElement(model="payload")
    root.compiler.angle = "radian"
    first = root.worldbody.add("body", name="payload")
    second = first.add("body", name=SECOND)
    kind = "slide" if joint.slides else "hinge"
    spring = {"stiffness": joint.stiffness, "springref": joint.rest} if joint.stiffness else {}
    second.add(
        "joint",
        name="joint",
        type=kind,
        pos=joint.pivot_1,
        axis=joint.axis_1,
        damping=joint.damping,
        **spring,
    )
    look = {"group": 2, "contype": 0, "conaffinity": 0, "mass": 0.0}
    for body, (mass, com, inertia), rgba in zip((first, second), bodies, COLOURS, strict=True):
        _check_inertia(inertia)
        six = [inertia[at] for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        body.add("inertial", pos=com, mass=mass, fullinertia=six)
        body.add("geom", name=f"{body.name}_com", type="sphere", pos=com, size=[0.02], rgba=rgba, **look)
    for i, X in enumerate(X_1i):
        side = int(joint.second[i])
        body, com = (first, second)[side], bodies[side][1]
        quat = Rotation.from_matrix(X[:3, :3]).as_quat(scalar_first=True) if i else [1.0, 0.0, 0.0, 0.0]
        at = X[:3, 3] if i else np.zeros(3)
        body.add("site", name=f"grasp{i + 1}", pos=at, quat=quat, group=4, size=[0.006])
        if np.linalg.norm(at - com) > 1e-3:
            ends = [*com, *at]
            body.add(
                "geom",
                name=f"bar{i + 1}",
                type="capsule",
                fromto=ends,
                size=[0.01],
                rgba=COLOURS[side],
                **look,
            )
    # PyMJCF cannot read the root default class that it writes.
    return re.sub(r'<default>\s*<default class="/"/>\s*</default>\s*| class="/"', "", root.to_xml_string())


def nearest_inertia(inertia: Array, least_ratio: float) -> Array:
    """Find an inertia of a rigid body close to a given one: positive moments, none above the sum of the others.

    Args:
        inertia: symmetric inertia [kg m^2], shape (3, 3).
        least_ratio: lower limit of the smallest principal moment over the largest.
    """
    moments, axes = np.linalg.eigh(inertia)
    moments = np.maximum(moments, least_ratio * max(moments[-1], 1e-9))
    excess = moments[2] - moments[0] - moments[1]
    if excess > 0:  # change all moments by equal amounts until the largest is at most the sum of the others
        moments = moments + np.array([1.0, 1.0, -1.0]) * excess / 3.0 * 1.001
    return (axes * moments) @ axes.T


def _check_inertia(inertia: Array) -> None:
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all():
        raise InputError("payload inertia is not 3 x 3 finite numbers; it must be")
    if np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
        raise InputError("payload inertia is not symmetric; it must be")
    moments = np.linalg.eigvalsh(inertia)
    if not moments[0] > 0 or moments[2] > moments[0] + moments[1]:
        text = ", ".join(f"{moment:.4g}" for moment in moments)
        raise InputError(
            f"payload inertia has principal moments ({text}) kg m^2; all must be greater than 0 and the largest "
            "at most the sum of the others"
        )
