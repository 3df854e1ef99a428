"""A team as a recording and an estimate have it at one instant: a MuJoCo model to look at, and its state."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.arms import levelled, true_joints
from estimator.arm.design import OmnidDesign
from estimator.arm.gimbal import rotation
from estimator.arrays import Array
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import models_dir, omnid_design
from mocobot_sim.scene.omnid import load_omnid, stand
from mocobot_sim.scene.payload import load_payload
from mocobot_sim.scene.pymjcf import compiled, mjcf
from mocobot_view import colours
from mocobot_view.bodies.payload_shape import drawn_payload
from mocobot_view.bodies.poses import rod_angles
from mocobot_view.bodies.robot import LEGS, TINTED, fit_design, robot_shapes
from mocobot_view.facts.body_facts import BodyFacts, check_robots, facts_of, held
from mocobot_view.facts.known_robots import as_estimated, tilted
from mocobot_view.facts.placement import Bases, Grasps, placed

SAMPLES = 2000
"""Samples, spread over a recording, from which bases are placed."""
GHOST = 0.15
"""Opacity of a payload that must not hide what is inside; MuJoCo draws what is translucent twice."""


@dataclass(frozen=True, eq=False)
class MeasuredTeam:
    """A team at one instant.

    Attributes:
        model: robots ``omnid1/`` .. ``omnidN/`` at their bases, and the payload ``payload/`` if its CAD is drawn.
        qpos: state that the measured angles ask for.
        time_s: the instant, since the first sample [s].
        facts: what the estimate knows of the payload.
        R_W1, p_W1: pose of the payload's frame {1} in the world, shapes (3, 3) and (3,) [m]; None where the grasps
            are not known.
        grasps: how it is held, or None.
        has_cad: whether the payload's CAD is in the model.
        notes: what a viewer should know, sentences.
    """

    model: mujoco.MjModel
    qpos: Array
    time_s: float
    facts: BodyFacts
    R_W1: Array | None
    p_W1: Array | None
    grasps: Grasps | None
    has_cad: bool
    notes: tuple[str, ...]

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return sum(self.model.body(b).name.endswith("/flange") for b in range(self.model.nbody))


def measured_team(
    recording: Recording,
    estimate: PayloadEstimate,
    payload: str | Path | None = None,
    time_s: float | None = None,
) -> MeasuredTeam:
    """Put robots and payload where measured angles and estimated grasps have them.

    Args:
        recording: one trial.
        estimate: of the payload.
        payload: name or MJCF of the payload's geometry; None for what the recording's label names, if that fits.
        time_s: instant since the first sample [s]; None for the middle of the recording.

    Raises:
        InputError: the estimate is of another number of robots, the rods do not meet, or ``payload`` is not a payload
            for these robots.
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
    bases, motion = placed(R_bi, p_bi, grasps, height, slice(-1, None))
    pose = None if motion is None else (motion.R_W1[0], motion.p_W1[0])
    drawn = None if grasps is None else drawn_payload(payload, meta.payload, grasps, notes)
    if grasps is None:
        notes.append("The grasps are not known: the robots are drawn in a row, without a payload.")
    model = _model(tilted(bases, meta.arms), drawn, meta.design, height)
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
    """Robots of a design at given bases, links in their colours, and a payload that floats."""
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
    """State of a model; angles are phi, theta, wrist [m], swing and tilt of the rods, shape (N, 3) each."""
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
