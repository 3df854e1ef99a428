"""The payload of a replay in Rerun: where the grasps say it is, and what is known of its body."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from mocobot_view import colours
from mocobot_view.colours import Colour
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.replay.log_robots import log_label, log_shape
from mocobot_view.replay.log_time import send_poses
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.sizes import FRAME_M


def log_payload(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log the payload below the trial's root, in frame {1}; nothing where its grasps are not known."""
    if trial.motion is None:
        return
    payload = f"{trial.name}/payload"
    send_poses(stream, payload, trial.time, trial.motion.p_W1, trial.motion.quaternion)
    if trial.shape is not None:
        log_shape(stream, f"{payload}/shape", trial.shape)
    if trial.facts is not None:
        _log_facts(stream, f"{payload}/estimate", trial.facts, "", colours.ESTIMATE, thick=1.0)
    if trial.truth is not None:
        # Longer and thinner, so that both show where they agree.
        _log_facts(stream, f"{payload}/truth", trial.truth, " true", colours.TRUTH, thick=0.5)


def _log_facts(
    stream: rr.RecordingStream, path: str, facts: BodyFacts, suffix: str, colour: Colour, thick: float
) -> None:
    """Grasp frames, centre of mass, principal axes and inertia ellipsoid in {1}."""
    longer = FRAME_M * (1.0 if thick == 1.0 else 1.5)
    if facts.grasps is not None:
        for i, (p, R) in enumerate(zip(facts.grasps.p_1i, facts.grasps.R_1i, strict=True), start=1):
            _log_axes(stream, f"{path}/grasp{i}", p, longer * R, colours.AXES, 0.006 * thick)
            log_label(stream, f"{path}/grasp{i}/name", p, f"{{{i}}}{suffix}", colour, show=not suffix)
    if facts.p_1c is None:
        return
    com = rr.Points3D([facts.p_1c], colors=[colour], radii=0.022 * thick)
    stream.log(f"{path}/com", com, static=True)
    log_label(stream, f"{path}/com/name", facts.p_1c, f"CoM{suffix}", colour, show=not suffix)
    semi_axes = facts.semi_axes_m()
    if semi_axes is None or facts.R_1c is None:
        return
    inertia = rr.Ellipsoids3D(
        half_sizes=[semi_axes],
        centers=[facts.p_1c],
        quaternions=[Rotation.from_matrix(facts.R_1c).as_quat()],
        colors=[colour],
        line_radii=0.002 * thick,
        fill_mode=rr.components.FillMode.MajorWireframe,
    )
    stream.log(f"{path}/inertia", inertia, static=True)
    if facts.axes_known:
        _log_axes(stream, f"{path}/axes", facts.p_1c, facts.R_1c * semi_axes, [colour] * 3, 0.005 * thick)


def _log_axes(
    stream: rr.RecordingStream, path: str, at: Array, axes: Array, tones: Sequence[Colour], radius_m: float
) -> None:
    """Three arrows from a point (3,), the columns of ``axes`` (3, 3), in {1} [m]."""
    arrows = rr.Arrows3D(origins=np.tile(at, (3, 1)), vectors=axes.T, colors=tones, radii=radius_m)
    stream.log(path, arrows, static=True)
