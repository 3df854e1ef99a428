"""Pose, geometry and joint of a payload of two bodies in one recording, for drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.model import Recording
from estimator.two_bodies.relative import relative_motion
from estimator.two_bodies.result import TwoBodies
from estimator.two_bodies.start import bases_of
from estimator.two_bodies.team import Pair
from mocobot_sim.scene.models import payload_names, posed
from mocobot_sim.scene.payload import SECOND, load_payload, payload_joint
from mocobot_sim.scene.pymjcf import compiled
from mocobot_view.payload import BAR_M, BAR_RGBA, Bases, Grasps, PayloadMotion, payload_motion
from mocobot_view.shapes import Shape, body_shape, capsule, join

STRIDE = 20
"""Step between the samples that place the bases. Chosen."""


@dataclass(frozen=True, eq=False)
class TwoBodyMotion:
    """Two bodies as the encoders of one recording show them.

    Attributes:
        first: motion of the body that robot 1 holds, with the gaps of all robots.
        second: motion of the other body's frame {k}, the grasp of its first robot.
        bases: poses of the bases.
        shapes: shapes in {1} and {k}, each None if there is nothing to draw.
        axis, pivot: direction of the joint in {1}, and the point where it is drawn [m], shapes (3,).
        slides: whether the joint is a slide.
        q: position of the joint [rad or m], shape (Q,).
        sentence: the finding in words.
    """

    first: PayloadMotion
    second: PayloadMotion
    bases: Bases
    shapes: tuple[Shape | None, Shape | None]
    axis: Array
    pivot: Array
    slides: bool
    q: Array
    sentence: str


def two_body_motion(
    recording: Recording, R_bi: Array, p_bi: Array, height_m: float, given: TwoBodies | None = None
) -> TwoBodyMotion | None:
    """Find two bodies in a recording by its kinematics; None if one body or none explains it better.

    Args:
        recording: one trial.
        R_bi, p_bi: grasps in level base frames, shapes (Q, N, 3, 3) and (Q, N, 3) [m].
        height_m: height of {b1} over the floor [m].
        given: estimate whose grasps and joint are taken; None to find them here.
    """
    if given is not None:
        pair = given.pair(())
        pair = given.pair((bases_of(pair, (R_bi[::STRIDE], p_bi[::STRIDE])),))
    else:
        try:
            best = relative_motion([recording])[0]
        except InputError:
            return None
        if best.axis is None:
            return None
        pair = best.fitted.point.pair
    own, axis, slides = pair.bases[0], pair.joint.axes[:, 0], pair.joint.motion == "sliding"
    bases = Bases(own.R, own.p + np.array([0.0, 0.0, height_m]))
    each = []
    for half in pair.halves:
        at = list(half)
        of_half = Bases(bases.R_Wb[at], bases.p_Wb[at])
        each.append(payload_motion(R_bi[:, at], p_bi[:, at], Grasps(pair.R[at], pair.p[at]), of_half))
    order = np.argsort(np.concatenate(pair.halves))
    gaps = [np.concatenate([getattr(one, name) for one in each], axis=1)[:, order]
            for name in ("gap_rotation_rad", "gap_position_m")]  # fmt: skip
    first = replace(each[0], gap_rotation_rad=gaps[0], gap_position_m=gaps[1])
    _, joint, pose = pair.loops(R_bi, p_bi, own)
    pivot = pose[1].mean(axis=0) / 2.0  # halfway between the first robots of both bodies
    if not slides:
        pivot = pair.joint.pivot + axis * (axis @ (pivot - pair.joint.pivot))
    back = Rotation.from_matrix(pair.joint.R_0).inv()
    shapes = _cad(recording, pair.halves) or (
        _bars(pair.p[list(pair.halves[0])], pivot),
        _bars(pair.p[list(pair.halves[1])], back.apply(pivot - pair.joint.p_0)),
    )
    return TwoBodyMotion(first, each[1], bases, shapes, axis, pivot, slides, joint.q, _said(pair, joint.q))


def _said(pair: Pair, q: Array) -> str:
    """Describe the joint and its motion in a sentence."""
    first, second = (
        f"robot{'s' * (len(half) > 1)} {', '.join(str(i + 1) for i in half)}" for half in pair.halves
    )
    size = float(np.std(q))
    shown = f"{1e3 * size:.0f} mm" if pair.joint.motion == "sliding" else f"{np.rad2deg(size):.1f} deg"
    return (
        f"The payload is {pair.joint.motion} between {first} and {second}; the joint moves by {shown} (rms)."
    )


def _cad(recording: Recording, halves: Sequence[Sequence[int]]) -> tuple[Shape | None, Shape | None] | None:
    """Shapes of a shipped payload of two bodies, if the same robots hold them."""
    label = recording.metadata.payload
    if label not in payload_names():
        return None
    model = compiled(load_payload(label))
    joint = payload_joint(model)
    if joint is None or tuple(i for i, on in enumerate(joint.second) if on) != tuple(halves[1]):
        return None
    data, site = posed(model), model.site(f"grasp{halves[1][0] + 1}").id
    frame = data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in ("payload", SECOND)]
    return body_shape(model, ids[:1]), body_shape(model, ids[1:], frame)


def _bars(grasps: Array, pivot: Array) -> Shape | None:
    """Bars from the joint to the grasps of one body."""
    meshes = []
    for p in grasps:
        length = float(np.linalg.norm(p - pivot))
        if length > BAR_M:
            turn = Rotation.align_vectors([p - pivot], [[0.0, 0.0, 1.0]])[0].as_matrix()
            meshes.append(capsule(BAR_M, 0.5 * length).moved(0.5 * (p + pivot), turn))
    return Shape.of(join(meshes), BAR_RGBA) if meshes else None
