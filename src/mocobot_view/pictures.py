"""Pictures of teams: as designed, as estimated, and with the causes of a diagnosis.

A shot describes a picture; a view is the rendered picture. ``render_shots`` renders several shots in one process.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.result.read import NamedCause
from estimator.arm.design import OmnidDesign
from estimator.arm.dynamics import rotation
from estimator.arm.unit import levelled, true_joints
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import models_dir, omnid_design, posed
from mocobot_sim.scene.omnid import load_omnid, stand
from mocobot_sim.scene.payload import load_payload
from mocobot_sim.scene.pymjcf import compiled, mjcf
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_view import colours
from mocobot_view.camera import Marks, clearest, corners
from mocobot_view.colours import MARK_M, Colour
from mocobot_view.payload import (
    BAR_M,
    BAR_RGBA,
    Bases,
    BodyFacts,
    Grasps,
    as_estimated,
    check_robots,
    drawn_payload,
    facts_of,
    held,
    placed,
)
from mocobot_view.render import Picture, Shot, render_shots
from mocobot_view.robot import LEGS, TINTED, body_of, by_place, fit_design, robot_shapes, rod_angles

SAMPLES = 2000  # number of samples, spread over a recording, that determine the poses of the bases. Chosen.
GHOST = 0.15
"""Opacity of a payload that must not hide its interior; MuJoCo draws translucent geoms twice. Chosen."""


@dataclass(frozen=True, eq=False)
class MeasuredTeam:
    """A team at one instant of a recording."""

    # robots ``omnid1/`` .. ``omnidN/`` at their bases, and the payload ``payload/`` if its CAD is drawn.
    model: mujoco.MjModel
    qpos: Array  # state of the model for the measured angles
    time_s: float  # time since the first sample [s]
    facts: BodyFacts  # estimated quantities of the payload
    # R_W1, p_W1: pose of the payload's frame {1} in the world, shapes (3, 3) and (3,) [m]; None if the grasps are
    # unknown
    R_W1: Array | None
    p_W1: Array | None
    grasps: Grasps | None  # grasps of the payload, or None
    has_cad: bool  # whether the model contains the payload's CAD
    notes: tuple[str, ...]  # sentences for the viewer

    @property
    def robots(self) -> int:
        return sum(self.model.body(b).name.endswith("/flange") for b in range(self.model.nbody))


def measured_team(
    recording: Recording,
    estimate: PayloadEstimate,
    payload: str | Path | None = None,
    time_s: float | None = None,
) -> MeasuredTeam:
    """Pose robots and payload by the measured angles and the estimated grasps.

    Args:
        recording: one trial.
        estimate: estimate of the payload, of as many robots.
        payload: name or MJCF of the payload's geometry; None for that of the recording's label, if it fits.
        time_s: time since the first sample [s]; None for the middle of the recording.
    """
    recording = as_estimated(recording, estimate)
    meta, notes = recording.metadata, []
    check_robots(estimate, recording)
    since = recording.time - recording.time[0]
    now = len(since) // 2 if time_s is None else int(np.argmin(np.abs(since - time_s)))
    samples = np.append(np.linspace(0, len(since) - 1, min(len(since), SAMPLES)).astype(int), now)
    parts = (channels[samples] for channels in (recording.phi, recording.theta, recording.tau))
    phi, theta, _ = true_joints(meta.arms, *parts)
    wrist, swing, tilt = rod_angles(phi, meta.arms)
    R_bi, p_bi = levelled(meta.arms, rotation(theta), wrist)
    height = robot_shapes(meta.design).base_height_m
    facts = facts_of(estimate)
    grasps = held(facts, meta.robots)
    bases, motion = placed(R_bi, p_bi, grasps, height, meta.arms, slice(-1, None))
    pose = None if motion is None else (motion.R_W1[0], motion.p_W1[0])
    drawn = None if grasps is None else drawn_payload(payload, meta.payload, grasps, notes)
    if grasps is None:
        notes.append("The grasps are not known: the robots are drawn in a row, without a payload.")
    model = _model(bases, drawn, meta.design, height)
    angles = (phi[-1], theta[-1], wrist[-1], swing[-1], tilt[-1])
    return MeasuredTeam(
        model=model,
        qpos=_qpos(model, angles, pose if drawn is not None else None),
        time_s=float(since[now]),
        facts=facts,
        R_W1=None if pose is None else pose[0],
        p_W1=None if pose is None else pose[1],
        grasps=grasps,
        has_cad=drawn is not None,
        notes=tuple(notes),
    )


def _model(bases: Bases, payload: str | Path | None, design: OmnidDesign, height_m: float) -> mujoco.MjModel:
    """Build a model of robots at given bases, with coloured links, and a free-floating payload."""
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    turns = Rotation.from_matrix(bases.R_Wb).as_quat(scalar_first=True)
    feet = bases.p_Wb - bases.R_Wb @ [0.0, 0.0, height_m]
    for i, (p, quat) in enumerate(zip(feet, turns, strict=True), start=1):
        stand(root, load_omnid(i), p, quat)
    if payload is not None:
        root.worldbody.attach(load_payload(payload)).add("freejoint")
    model = compiled(root)
    for i in range(1, len(turns) + 1):
        fit_design(model, design, f"omnid{i}/")
        for name in TINTED:
            model.geom_rgba[model.geom(f"omnid{i}/{name}").id, :3] = np.array(colours.of_robot(i)) / 255.0
    for g in range(model.ngeom):
        if model.geom(g).name.startswith("payload/") or model.body(model.geom_bodyid[g]).name.startswith(
            "payload/"
        ):
            model.geom_rgba[g, 3] *= GHOST
            if model.geom_matid[g] >= 0:
                model.mat_rgba[model.geom_matid[g], 3] = GHOST
    return model


def _qpos(
    model: mujoco.MjModel, angles: tuple[Array, Array, Array, Array, Array], pose: tuple[Array, Array] | None
) -> Array:
    """Compute the state of a model from phi, theta, wrist position [m], swing and tilt of the rods, (N, 3) each."""
    qpos, shipped = model.qpos0.copy(), omnid_design()

    def put(joint: str, value: float) -> None:
        qpos[model.joint(joint).qposadr[0]] = value

    for i, (phi, theta, wrist, swing, tilt) in enumerate(zip(*angles, strict=True), start=1):
        for k in LEGS:
            w, _, y, _ = model.body(f"omnid{i}/rod{k}").quat
            put(f"omnid{i}/motor{k}", phi[k - 1] - home_phi(shipped))
            put(f"omnid{i}/knee{k}_swing", swing[k - 1] - 2.0 * np.arctan2(y, w))
            put(f"omnid{i}/knee{k}_tilt", tilt[k - 1])
        for axis, angle in zip("zyx", theta, strict=True):
            put(f"omnid{i}/gimbal_{axis}", angle)
        for axis, shift in zip("xyz", wrist - model.body(f"omnid{i}/platform").pos, strict=True):
            put(f"omnid{i}/platform_{axis}", shift)
    if pose is not None:
        at = model.qpos0.size - 7
        qpos[at : at + 3] = pose[1]
        qpos[at + 3 :] = Rotation.from_matrix(pose[0]).as_quat(scalar_first=True)
    return qpos


ASPECT = 1.6  # default width over height of a picture
AZIMUTH, ELEVATION, FOVY = 125.0, -24.0, 28.0
"""Direction and angle of view [deg]. Chosen: a narrow angle avoids enlarging near objects."""
ABOVE = -34.0  # elevation for pictures with marks at the payload [deg]. Chosen.
LONG_M = 0.17  # length of the axes of a grasp frame [m]. Chosen: they must protrude from the gimbal.
NAME_AT = np.array([0.0, 0.0, 0.05])
AROUND = np.linspace(0.0, 2.0 * np.pi, 73)


def _rgba(colour: Colour) -> tuple[float, float, float, float]:
    red, green, blue = (part / 255.0 for part in colour)
    return red, green, blue, 1.0


RED = _rgba(colours.FAULT)


def team_shot(payload: str | Path, aspect: float = ASPECT) -> Shot:
    """Describe a picture, ``aspect`` times as wide as high, of a team as designed, at rest, with a payload."""
    scene = build_team(payload)
    model = scene.compile()
    data = mujoco.MjData(model)
    assemble_at_home(scene, model, data, TeamIndex.of(model))
    says = f"{scene.robots} Omnids hold payload {payload}, as designed."
    return _shot(model, data.qpos.copy(), Marks(), says, aspect)


def estimate_shot(
    recording: Recording,
    estimate: PayloadEstimate,
    truth: BodyFacts | None = None,
    payload: str | Path | None = None,
    time_s: float | None = None,
    aspect: float = ASPECT,
) -> Shot:
    """Describe a picture of an estimated team at one instant, with grasp frames, centre of mass and inertia.

    The ``truth`` is drawn beside the estimate; other arguments as for ``measured_team`` and ``team_shot``.
    """
    team = measured_team(recording, estimate, payload, time_s)
    marks = Marks()
    _bars(marks, team)
    _facts(marks, team, team.facts, colours.ESTIMATE, thick=1.0)
    if truth is not None:
        _facts(marks, team, truth, colours.TRUTH, thick=0.5)
    _names(marks, team)
    return _shot(team.model, team.qpos, marks, _says(recording, team, truth), aspect, ABOVE)


def diagnosis_shot(recording: Recording, estimate: PayloadEstimate, causes: Sequence[NamedCause]) -> Shot:
    """Describe a picture of an estimated team with the causes of a diagnosis in red at their places.

    A cause must not name a robot that the recording does not have.
    """
    team = measured_team(recording, estimate)
    for cause in causes:
        if cause.robot is not None and cause.robot > team.robots:
            raise InputError(
                f"the diagnosis names robot {cause.robot}; {recording.name} is of {team.robots} robots"
            )
    marks, guilty = Marks(), any(cause.robot is None for cause in causes)
    _bars(marks, team, RED if guilty else BAR_RGBA)
    _names(marks, team)
    _causes(marks, team, causes)
    where = [f"{cause.label or cause.name} ({_place(cause)})" for cause in causes]
    found = f" Red: {', '.join(where)}." if where else " No cause is named."
    says = _says(recording, team, None, marked=False) + found
    return _shot(team.model, team.qpos, marks, says, ASPECT, ABOVE)


def _shot(
    model: mujoco.MjModel, qpos: Array, marks: Marks, says: str, aspect: float, elevation: float = ELEVATION
) -> Shot:
    """Choose the view in which the robots hide each other least, and turn the light with the camera."""
    model.vis.global_.fovy = FOVY
    points = np.concatenate([corners(model, qpos), marks.points()])
    data = posed(model, qpos)
    chassis = [b for b in range(model.nbody) if model.body(b).name.endswith("/chassis")]
    feet = data.xpos[chassis].reshape(-1, 3)
    best = clearest(points, feet, AZIMUTH, elevation, aspect, FOVY)
    turn = Rotation.from_rotvec([0.0, 0.0, best.azimuth - AZIMUTH], degrees=True).as_matrix()
    centre = model.stat.center * [1.0, 1.0, 0.0]
    moved = np.append(feet.mean(axis=0)[:2], 0.0) if len(feet) else centre
    model.light_pos[:] = (model.light_pos - centre) @ turn.T + moved
    model.light_dir[:] = model.light_dir @ turn.T
    return Shot(model, qpos, best, marks, says)


def _says(recording: Recording, team: MeasuredTeam, truth: BodyFacts | None, *, marked: bool = True) -> str:
    omnids = f"{team.robots} Omnid{'s' if team.robots != 1 else ''}"
    text = f"{omnids} at {team.time_s:.1f} s of {Path(recording.name).name}, from the measured angles"
    if team.grasps is None:
        return f"{text}. {' '.join(team.notes)}"
    bars = "" if team.has_cad else "; bars stand for the payload, whose shape is not known"
    parts = [f"{text} and the estimated grasps{bars}."]
    facts = team.facts
    if marked and facts.p_1c is not None:
        ellipsoid = " and the ellipsoid of its inertia" if facts.semi_axes_m() is not None else ""
        parts.append(f"Magenta: the estimated centre of mass{ellipsoid}.")
    if marked and facts.grasps is not None:
        parts.append("Red, green and blue arrows: x, y and z of the grasp frames.")
    if truth is not None:
        parts.append("Green and thin: the truth.")
    return " ".join([*parts, *team.notes])


def _in_world(team: MeasuredTeam, point: Array) -> Array:
    assert team.R_W1 is not None
    assert team.p_W1 is not None
    return team.R_W1 @ point + team.p_W1


def _bars(marks: Marks, team: MeasuredTeam, rgba: Sequence[float] = BAR_RGBA) -> None:
    """Draw bars from the centre of mass to the grasps, if the CAD is unknown."""
    if team.grasps is None or team.has_cad:
        return
    centre = team.facts.p_1c if team.facts.p_1c is not None else team.grasps.p_1i.mean(axis=0)
    for p in team.grasps.p_1i:
        marks.path([_in_world(team, centre), _in_world(team, p)], BAR_M, rgba)


def _facts(marks: Marks, team: MeasuredTeam, facts: BodyFacts, colour: Colour, thick: float) -> None:
    """Draw grasp frames, centre of mass and inertia ellipsoid."""
    if team.R_W1 is None:
        return
    longer = LONG_M * (1.0 if thick == 1.0 else 1.25)
    if facts.grasps is not None:
        for p, R in zip(facts.grasps.p_1i, facts.grasps.R_1i, strict=True):
            start = _in_world(team, p)
            for axis, tone in zip((team.R_W1 @ R).T, colours.AXES, strict=True):
                marks.arrow(start, start + longer * axis, 0.009 * thick, _rgba(tone))
    if facts.p_1c is None:
        return
    centre = _in_world(team, facts.p_1c)
    marks.ellipsoid(centre, 0.026 * thick, _rgba(colour))
    semi_axes = facts.semi_axes_m()
    if semi_axes is None or facts.R_1c is None:
        return
    R = team.R_W1 @ facts.R_1c
    # Draw the three principal ellipses, because a solid ellipsoid would cast a shadow.
    for k in range(3):
        one, other = R[:, k - 1] * semi_axes[k - 1], R[:, k - 2] * semi_axes[k - 2]
        ellipse = centre + np.cos(AROUND)[:, None] * one + np.sin(AROUND)[:, None] * other
        marks.path(ellipse, 0.004 * thick, _rgba(colour))


def _names(marks: Marks, team: MeasuredTeam) -> None:
    """Write every robot's name at its foot in its colour."""
    data = posed(team.model, team.qpos)
    for i in range(1, team.robots + 1):
        marks.label(f"omnid{i}", data.body(f"omnid{i}/chassis").xpos + NAME_AT, colours.of_robot(i))


def _place(cause: NamedCause) -> str:
    if cause.robot is None:
        return "payload"
    return f"omnid{cause.robot}" + (f", {body}" if (body := body_of(cause)) else "")


def _causes(marks: Marks, team: MeasuredTeam, causes: Sequence[NamedCause]) -> None:
    """Mark every cause with a red ball, a red body and its name; causes at one place share a mark."""
    data = posed(team.model, team.qpos)
    for (robot, body), here in by_place(causes).items():
        if robot is None:
            if team.R_W1 is None:
                continue
            where = _in_world(team, team.facts.p_1c if team.facts.p_1c is not None else np.zeros(3))
            bodies = [b for b in range(team.model.nbody) if team.model.body(b).name.startswith("payload/")]
        else:
            found = team.model.body(f"omnid{robot}/{body or 'base'}").id
            where, bodies = data.xpos[found], [found]
        seen = np.isin(team.model.geom_bodyid, bodies)
        team.model.geom_rgba[seen, :3] = RED[:3]
        marks.ellipsoid(where, MARK_M, (*RED[:3], 0.45))
        text = ", ".join(cause.kind or cause.name for cause in here)
        marks.label(text, where + np.array([0.0, 0.0, 2.0 * MARK_M]), colours.FAULT)


WIDTH, HEIGHT = 1600, 1000


def team_view(payload: str | Path, width: int = WIDTH, height: int = HEIGHT) -> Picture | str:
    """Render a team as designed, at rest, with a payload; see ``team_shot``.

    Returns:
        Picture of shape (height, width, 3), or one sentence that explains why there is none.
    """
    return _one(team_shot(payload, width / height), width, height)


def estimate_view(
    recording: Recording,
    estimate: PayloadEstimate,
    width: int = WIDTH,
    height: int = HEIGHT,
    *,
    truth: BodyFacts | None = None,
    payload: str | Path | None = None,
    time_s: float | None = None,
) -> Picture | str:
    """Render an estimated team at one instant; see ``estimate_shot``.

    Returns:
        Picture of shape (height, width, 3), or one sentence that explains why there is none.
    """
    return _one(estimate_shot(recording, estimate, truth, payload, time_s, width / height), width, height)


def _one(shot: Shot, width: int, height: int) -> Picture | str:
    made = render_shots([shot], width, height)
    return made if isinstance(made, str) else made[0]
