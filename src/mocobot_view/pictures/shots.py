"""What pictures of teams show: a payload as designed, an estimate, and where a diagnosis sees causes."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.result.read import NamedCause
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_sim.scene.models import models_dir, posed
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_view import colours
from mocobot_view.bodies.payload_shape import BAR_M, BAR_RGBA
from mocobot_view.colours import Colour
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.cause_body import body_of, by_place
from mocobot_view.pictures.camera import Camera, corners, framing, pixels
from mocobot_view.pictures.marks import Marks
from mocobot_view.pictures.measured_team import MeasuredTeam, measured_team
from mocobot_view.pictures.render import Shot
from mocobot_view.sizes import MARK_M

ASPECT = 1.6
"""Width over height of a picture that shots are framed for, if nothing else is said."""
AZIMUTH, ELEVATION, FOVY = 125.0, -24.0, 28.0
"""Direction and angle of view [deg]; a long lens, which does not blow up what is near."""
TURNS = (0.0, *(sign * turn for turn in range(15, 180, 15) for sign in (-1, 1)), 180.0)
"""Other directions that are tried [deg]; the first of equal ones is taken."""
ABOVE = -34.0
"""Elevation [deg] where marks at the payload are to be seen."""
LONG_M = 0.17
"""Length of a grasp frame's axes: they must stick out of the gimbal."""
NAME_AT = np.array([0.0, 0.0, 0.05])
AROUND = np.linspace(0.0, 2.0 * np.pi, 73)


def _rgba(colour: Colour) -> tuple[float, float, float, float]:
    red, green, blue = (part / 255.0 for part in colour)
    return red, green, blue, 1.0


RED = _rgba(colours.FAULT)


def team_shot(payload: str | Path, aspect: float = ASPECT) -> Shot:
    """A team as designed, at rest, holding a payload.

    Args:
        payload: name of a shipped payload, or path of a payload MJCF.
        aspect: width over height of the picture.

    Raises:
        InputError: there is no such payload, or robots cannot hold it.
    """
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
    """A team as estimated, at one measured instant, with grasp frames, centre of mass and inertia ellipsoid.

    Args:
        recording: one trial.
        estimate: of the payload.
        truth: of the payload, drawn beside the estimate.
        payload: name or MJCF of the payload's geometry; None for what the recording's label names, if that fits.
        time_s: instant since the first sample [s]; None for the middle of the recording.
        aspect: width over height of the picture.

    Raises:
        InputError: see ``measured_team``.
    """
    team = measured_team(recording, estimate, payload, time_s)
    marks = Marks()
    _bars(marks, team)
    _facts(marks, team, team.facts, colours.ESTIMATE, thick=1.0)
    if truth is not None:
        _facts(marks, team, truth, colours.TRUTH, thick=0.5)
    _names(marks, team)
    return _shot(team.model, team.qpos, marks, _says(recording, team, truth), aspect, ABOVE)


def diagnosis_shot(
    recording: Recording,
    estimate: PayloadEstimate,
    causes: Sequence[NamedCause],
    payload: str | Path | None = None,
    time_s: float | None = None,
    aspect: float = ASPECT,
) -> Shot:
    """A team as estimated, with the causes of a diagnosis in red where they sit.

    Args:
        recording, estimate, payload, time_s, aspect: as for ``estimate_shot``.
        causes: of ``discrepancy.result.read.read_diagnosis``.

    Raises:
        InputError: see ``measured_team``; or a cause sits at a robot that the recording does not have.
    """
    team = measured_team(recording, estimate, payload, time_s)
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
    return _shot(team.model, team.qpos, marks, says, aspect, ABOVE)


def axis_shot(aspect: float = ASPECT) -> Shot:
    """The EMPS axis, its carriage at the middle of its way."""
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "emps" / "scene.xml"))
    says = "The EMPS axis: a carriage on a ball screw."
    return _shot(model, model.key("hold").qpos.copy(), Marks(), says, aspect)


def _shot(
    model: mujoco.MjModel, qpos: Array, marks: Marks, says: str, aspect: float, elevation: float = ELEVATION
) -> Shot:
    """Look from where the robots hide each other least, with the light behind the camera's shoulder."""
    model.vis.global_.fovy = FOVY
    points = np.concatenate([corners(model, qpos), marks.points()])
    data = posed(model, qpos)
    chassis = [b for b in range(model.nbody) if model.body(b).name.endswith("/chassis")]
    feet = data.xpos[chassis].reshape(-1, 3)

    def apart(camera: Camera) -> float:
        """Least distance of two robots in the picture, widths counting double, because robots are tall."""
        at = pixels(camera, feet, 2.0 * aspect, 1.0, FOVY)
        return min((float(np.linalg.norm(a - b)) for a, b in combinations(at, 2)), default=0.0)

    cameras = [framing(points, AZIMUTH + turn, elevation, aspect, FOVY) for turn in TURNS]
    best = max(cameras, key=apart)
    turn = Rotation.from_rotvec([0.0, 0.0, best.azimuth - AZIMUTH], degrees=True).as_matrix()
    centre = model.stat.center * [1.0, 1.0, 0.0]
    moved = np.append(feet.mean(axis=0)[:2], 0.0) if len(feet) else centre
    model.light_pos[:] = (model.light_pos - centre) @ turn.T + moved
    model.light_dir[:] = model.light_dir @ turn.T
    return Shot(model, qpos, best, marks, says)


def _says(recording: Recording, team: MeasuredTeam, truth: BodyFacts | None, *, marked: bool = True) -> str:
    """Words for what is to be seen."""
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
    """Bars from the centre of mass to the grasps, where no CAD is known."""
    if team.grasps is None or team.has_cad:
        return
    centre = team.facts.p_1c if team.facts.p_1c is not None else team.grasps.p_1i.mean(axis=0)
    for p in team.grasps.p_1i:
        marks.path([_in_world(team, centre), _in_world(team, p)], BAR_M, rgba)


def _facts(marks: Marks, team: MeasuredTeam, facts: BodyFacts, colour: Colour, thick: float) -> None:
    """Grasp frames, centre of mass, principal axes and inertia ellipsoid."""
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
    # Its three principal ellipses: a filled one would throw its shadow on everything.
    for k in range(3):
        one, other = R[:, k - 1] * semi_axes[k - 1], R[:, k - 2] * semi_axes[k - 2]
        ellipse = centre + np.cos(AROUND)[:, None] * one + np.sin(AROUND)[:, None] * other
        marks.path(ellipse, 0.004 * thick, _rgba(colour))


def _names(marks: Marks, team: MeasuredTeam) -> None:
    """Every robot's name at its foot, in its colour."""
    data = posed(team.model, team.qpos)
    for i in range(1, team.robots + 1):
        marks.label(f"omnid{i}", data.body(f"omnid{i}/chassis").xpos + NAME_AT, colours.of_robot(i))


def _place(cause: NamedCause) -> str:
    if cause.robot is None:
        return "payload"
    return f"omnid{cause.robot}" + (f", {body}" if (body := body_of(cause)) else "")


def _causes(marks: Marks, team: MeasuredTeam, causes: Sequence[NamedCause]) -> None:
    """A red ball at the body of every cause, the body in red, and its name; several at one place share a mark."""
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
