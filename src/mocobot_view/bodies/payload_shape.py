"""What the payload looks like: its CAD geometry where that is known, else bars from its centre to the grasps."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError
from mocobot_sim.scene.models import payload_names
from mocobot_sim.scene.payload import grasp_frames, load_payload
from mocobot_sim.scene.pymjcf import compiled
from mocobot_view.bodies.primitives import capsule, join
from mocobot_view.bodies.shapes import Shape, body_shape
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.placement import Grasps

BAR_M, BAR_RGBA = 0.012, (0.55, 0.60, 0.70, 1.0)
FAR_M, FAR_RAD = 0.1, np.deg2rad(15.0)
"""Grasps further than this from the CAD's are not grasps of that payload."""


def cad_shape(payload: str | Path, robots: int) -> tuple[Shape | None, Grasps]:
    """Geometry of a payload in {1}, and its grasps by CAD.

    Args:
        payload: name of a shipped payload, or path of a payload MJCF.
        robots: number of robots that hold it.

    Raises:
        InputError: the file is not a payload MJCF, or has another number of grasps.
    """
    root = load_payload(payload)
    frames = grasp_frames(root, str(payload))
    if len(frames) != robots:
        raise InputError(
            f"{payload}: the payload has {len(frames)} grasps; the recording is of {robots} robots"
        )
    model = compiled(root)
    grasps = Grasps(frames.rotation.as_matrix(), frames.translation)
    return body_shape(model, list(range(1, model.nbody))), grasps


def drawn_payload(
    payload: str | Path | None, label: str | None, grasps: Grasps, notes: list[str]
) -> str | Path | None:
    """Which payload's CAD is to be drawn in given grasps; None for bars.

    Args:
        payload: what was asked for, a name or a payload MJCF; None for what the label names, if that fits.
        label: the recording's payload.
        grasps: how the payload is held.
        notes: what a viewer should know is added.

    Raises:
        InputError: what was asked for is not a payload for so many robots.
    """
    wanted = payload if payload is not None else label if label in payload_names() else None
    if wanted is None:
        return None
    try:
        elsewhere = held_elsewhere(cad_shape(wanted, len(grasps.p_1i))[1], grasps)
    except InputError as error:
        if payload is not None:
            raise
        elsewhere = str(error)
    if elsewhere is None:
        return wanted
    if payload is not None:
        notes.append(f"The geometry of payload {str(wanted)!r} is drawn as asked, but {elsewhere}.")
        return wanted
    notes.append(f"The geometry of payload {str(wanted)!r} is not drawn: {elsewhere}.")
    return None


def held_elsewhere(cad: Grasps, grasps: Grasps) -> str | None:
    """How a payload's CAD contradicts the grasps at hand, in words, or None."""
    X_cad, X = (RigidTransform.from_components(g.p_1i, Rotation.from_matrix(g.R_1i)) for g in (cad, grasps))
    apart = X_cad.inv() * X
    shift, turn = np.linalg.norm(apart.translation, axis=1), apart.rotation.magnitude()
    for i in np.flatnonzero((shift > FAR_M) | (turn > FAR_RAD)):
        return (
            f"grasp {i + 1} is {shift[i]:.2f} m and {np.rad2deg(turn[i]):.0f} deg from where its CAD has it"
        )
    return None


def bars(facts: BodyFacts) -> Shape | None:
    """A star of bars from the centre of mass, or the middle of the grasps, to every grasp; None if all coincide."""
    if facts.grasps is None:
        return None
    centre = facts.p_1c if facts.p_1c is not None else facts.grasps.p_1i.mean(axis=0)
    meshes = []
    for p in facts.grasps.p_1i:
        length = float(np.linalg.norm(p - centre))
        if length < BAR_M:
            continue
        turn = Rotation.align_vectors([p - centre], [[0.0, 0.0, 1.0]])[0].as_matrix()
        meshes.append(capsule(BAR_M, 0.5 * length).moved(0.5 * (p + centre), turn))
    return Shape.of(join(meshes), BAR_RGBA) if meshes else None
