"""Replays as they are written: poses, shapes, layout, and what is said of estimate, truth and diagnosis."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rerun.blueprint as rrb
from scipy.spatial.transform import RigidTransform, Rotation

from diagnosed import small_diagnosis
from discrepancy.result.read import NamedCause, WrittenDiagnosis, read_diagnosis
from estimator.arm.delta import inverse_kinematics
from estimator.arm.unit import AT
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from joint_logs import write_csv
from made_arm import JOINTS, MODEL, made, write_log, write_map, write_model
from mocobot import serial
from mocobot_sim.scene.models import models_dir, omnid_design, payload_path
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_view.joint_replay import joint_replay
from mocobot_view.payload import BAR_M
from mocobot_view.pictures import measured_team
from mocobot_view.replay_trial import ReplayTrial, replay_trial
from mocobot_view.robot import PATHS, body_motion, body_of, robot_shapes
from mocobot_view.shapes import Triangles, body_shape, box, capsule, cylinder, ellipsoid, join
from mocobot_view.stream import save_replay, summary
from omnid_design import DESIGN
from replay_case import BODIES, Placed, Replayed, payload_body, placed_trial, robot_body, true_estimate
from uncalibrated_team import knowing, uncalibrated


@pytest.fixture(scope="module")
def recording(random_a: TrialLog) -> Recording:
    return measure(random_a, sensor_preset("nominal"), np.random.default_rng(2), payload="a", name="rec")


def labelled(recording: Recording, payload: str | None) -> Recording:
    return replace(recording, metadata=replace(recording.metadata, payload=payload))


def part(recording: Recording, rows: slice, robots: int = 3) -> Recording:
    keep = rows, slice(0, robots)
    return replace(
        recording,
        time=recording.time[rows],
        phi=recording.phi[keep],
        theta=recording.theta[keep],
        tau=recording.tau[keep],
        ref=None,
        metadata=replace(recording.metadata, robots=robots, payload=None),
    )


def standing(recording: Recording, robots: int = 3) -> Recording:
    """The first second, in which nothing moves."""
    return part(recording, slice(0, 100), robots)


def test_without_grasps_robots_stand_in_a_row(recording: Recording, tmp_path: Path) -> None:
    trial = replay_trial(standing(recording), "still")
    assert trial.motion is None
    assert trial.shape is None
    assert trial.bases.p_Wb[:, 0] == pytest.approx([0.0, 1.2, 2.4])
    notes = " ".join(trial.notes)
    assert "Nothing could be estimated from this recording" in notes
    assert "drawn in a row, without a payload" in notes
    assert "--estimate" in notes
    assert "No twists and no wrenches" in notes
    save_replay([trial], tmp_path / "out.rrd")
    entities = Replayed(tmp_path / "out.rrd").entities()
    assert "still/omnid3/base/platform" in entities
    assert not any("payload" in name or "grasp" in name for name in entities)


def test_unknown_payloads_are_bars_to_the_grasps(recording: Recording) -> None:
    trial = replay_trial(labelled(recording, None), "rec")
    assert trial.facts is not None
    assert trial.facts.grasps is not None
    assert trial.shape is not None
    points = trial.shape.triangles.vertices
    for end in (*trial.facts.grasps.p_1i, trial.facts.p_1c):
        assert np.linalg.norm(points - end, axis=1).min() == pytest.approx(BAR_M, rel=1e-3)
    assert points.min(axis=0) == pytest.approx(trial.facts.grasps.p_1i.min(axis=0), abs=2 * BAR_M)
    assert not trial.notes


def test_estimates_that_do_not_belong(recording: Recording, teams) -> None:
    with pytest.raises(InputError, match="the estimate is of 5 robots; rec is of 3 robots"):
        replay_trial(recording, "rec", true_estimate(teams[5]))
    estimate = estimate_payload([recording])
    assert estimate.grasps is not None
    moved = estimate.grasps.moved(np.array([0.3, 0.0, 0.0, *np.zeros(9)]))
    trial = replay_trial(recording, "rec", replace(estimate, grasps=moved, payload="q"))
    assert "The estimate is of payload 'q'; this recording is of 'a'." in trial.notes
    assert any("grasps do not fit this recording" in note for note in trial.notes)
    assert not replay_trial(recording, "rec", estimate).notes


def test_axes_that_are_not_determined_are_not_drawn(recording: Recording, tmp_path: Path) -> None:
    estimate = estimate_payload([recording])
    assert estimate.inertia is not None
    blurred = replace(estimate.inertia.principal, R_1c=None, R_1c_covariance=None)
    trial = replay_trial(
        recording, "rec", replace(estimate, inertia=replace(estimate.inertia, principal=blurred))
    )
    save_replay([trial], tmp_path / "out.rrd")
    entities = Replayed(tmp_path / "out.rrd").entities()
    assert "rec/payload/estimate/inertia" in entities
    assert "rec/payload/estimate/axes" not in entities


def cause(name: str, robot: int | None, joint: int | None) -> NamedCause:
    return NamedCause(name, robot, joint, f"{name} [is] *here*.")


@pytest.mark.parametrize(
    ("name", "robot", "joint", "body"),
    [
        ("joint_friction", 1, 3, "proximal3"),
        ("theta_zero", 1, 1, "yoke"),
        ("gimbal_friction", 2, 2, "ring"),
        ("theta_zero", 1, 3, "flange"),
        ("tether", 3, None, "flange"),
        ("clock_delay", 3, None, None),
        ("drag", None, None, None),
    ],
)
def test_causes_sit_at_bodies(
    tmp_path: Path, name: str, robot: int | None, joint: int | None, body: str | None
) -> None:
    """The gimbal's joints 1, 2, 3 are z, y, x; those of the other causes are the legs."""
    values = small_diagnosis()
    values["causes"][0] |= {"cause": name, "robot": robot, "joint": joint}
    (tmp_path / "diagnosis.json").write_text(json.dumps(values), encoding="utf-8")
    (found,) = read_diagnosis(tmp_path).causes
    assert (found.name, found.robot, body_of(found)) == (name, robot, body)


def test_causes_are_marked_where_they_sit(recording: Recording, tmp_path: Path) -> None:
    causes = (
        cause("sea_bias", 2, 3), cause("joint_friction", 2, 3), cause("base_tilt", 1, None),
        cause("theta_zero", 3, 2), cause("slosh", None, None),
    )  # fmt: skip
    trial = replay_trial(recording, "rec", diagnosis=WrittenDiagnosis("explained", causes, ("rec",)))
    assert not trial.notes
    save_replay([trial], tmp_path / "out.rrd")
    file = Replayed(tmp_path / "out.rrd")
    for place, label in (
        ("omnid2/base/leg3/proximal", "! sea_bias, ! joint_friction"),
        ("omnid1/base", "! base_tilt"),
        ("omnid3/base/platform/yoke/ring", "! theta_zero"),
        ("payload", "! slosh"),
    ):
        assert file.texts(f"rec/{place}/cause/name", "Points3D:labels") == [label]
    assert sum(name.endswith("/cause") for name in file.entities()) == 4
    assert trial.facts is not None
    _, place = file.column("rec/payload/cause", "Points3D:positions")
    assert place[0] == pytest.approx(trial.facts.p_1c, abs=1e-6)
    assert "- **sea\\_bias**: sea\\_bias \\[is\\] \\*here\\*." in summary(trial)


ENCODER_RAD = np.pi / 2**16
"""Largest error of a 16-bit encoder."""


@pytest.fixture(scope="module")
def placed_a(team_a: TeamScene) -> Placed:
    return placed_trial(team_a)


def replayed(placed: Placed, folder: Path, preset: str = "ideal") -> tuple[ReplayTrial, Replayed]:
    trial = replay_trial(placed.recording(preset), "trial", true_estimate(placed.scene))
    save_replay([trial], folder / "out.rrd")
    return trial, Replayed(folder / "out.rrd")


def errors(ours: RigidTransform, mujoco: RigidTransform) -> tuple[float, float]:
    """Largest distance [m] and angle [rad]."""
    assert len(ours) == len(mujoco) > 300
    apart = ours.inv() * mujoco
    return float(np.linalg.norm(apart.translation, axis=1).max()), float(apart.rotation.magnitude().max())


def check_all(placed: Placed, file: Replayed, distance_m: float, angle_rad: float) -> None:
    samples = len(placed.log.time)
    moved = []
    for robot in range(1, placed.scene.robots + 1):
        for body in BODIES:
            true = robot_body(placed, robot, body)
            moved.append(np.ptp(true.translation, axis=0).max() + true.rotation.magnitude().std())
            distance, angle = errors(file.pose(placed.entity(robot, body), samples), true)
            assert distance < distance_m, (robot, body)
            assert angle < angle_rad, (robot, body)
    assert np.sort(moved)[-9 * placed.scene.robots] > 2e-3, "the bodies moved"
    distance, angle = errors(file.pose("trial/payload", samples), payload_body(placed))
    assert distance < distance_m
    assert angle < angle_rad


def test_bodies_agree_with_mujoco(placed_a: Placed, tmp_path: Path) -> None:
    """As far as MuJoCo's own rods and welds stay closed, and single precision goes."""
    check_all(placed_a, replayed(placed_a, tmp_path)[1], 2e-6, 5e-6)


def test_bodies_agree_to_encoder_accuracy(placed_a: Placed, tmp_path: Path) -> None:
    """A driven angle's error moves the wrist by up to 0.205 m/rad per leg, and the payload turns about its grasps."""
    trial, file = replayed(placed_a, tmp_path, "nominal")
    check_all(placed_a, file, 2.0 * ENCODER_RAD, 5.0 * ENCODER_RAD)
    assert trial.motion is not None
    assert 1e-6 < trial.motion.gap_position_m.max() < 2.0 * ENCODER_RAD


SOLIDS = {
    "box": (box([0.1, 0.2, 0.3]), 8 * 0.1 * 0.2 * 0.3),
    "ellipsoid": (ellipsoid([0.1, 0.2, 0.3]), 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    "capsule": (capsule(0.1, 0.3), np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 1e-3),
    "cylinder": (cylinder(0.1, 0.3), np.pi * 0.01 * 0.6),
    "two": (
        join([box([0.1, 0.2, 0.3]), box([0.1, 0.1, 0.1]).moved([1.0, 0, 0], np.eye(3))]),
        8 * (6e-3 + 1e-3),
    ),
}


def volume(mesh: Triangles) -> float:
    """By Gauss's theorem: right only if every face is there and turned outward."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_turned_outward(name: str) -> None:
    mesh, true = SOLIDS[name]
    assert volume(mesh) == pytest.approx(true, rel=1e-12 if name in ("box", "two") else 0.04)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    cosine = np.einsum("fj,fkj->fk", face, mesh.normals[mesh.faces])
    assert cosine.min() > np.cos(np.deg2rad(40.0)), "shading goes with the faces"


def nearest_surfaces(model: mujoco.MjModel, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """What a ray from 1 mm above each point, back along the normal, travels to a geom's surface [m], by MuJoCo.

    Of all geoms, the one whose surface is nearest to the point counts.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    start, best = points + 1e-3 * normals, np.full(len(points), np.inf)
    for g in range(model.ngeom):
        kind = model.geom_type[g]
        frame = data.geom_xpos[g], data.geom_xmat[g], model.geom_size[g]
        for k in range(len(points)):
            ray = start[k], -normals[k]
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                hit = mujoco.mj_rayMesh(model, data, g, *ray, None)
            else:
                hit = mujoco.mju_rayGeom(*frame, *ray, kind)
            if abs(hit - 1e-3) < abs(best[k] - 1e-3):
                best[k] = hit
    return best


def check_on_surfaces(model: mujoco.MjModel, bodies: list[int], every: int = 7) -> None:
    """Points of the mesh's faces, close to their corners, lie on MuJoCo's surfaces; facets are flat between them."""
    shape = body_shape(model, bodies)
    assert shape is not None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = shape.triangles.moved(data.xpos[bodies[0]], data.xmat[bodies[0]].reshape(3, 3))
    corners = mesh.vertices[mesh.faces[::every]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = 0.999 * corners[:, 0] + 0.001 * corners.mean(axis=1)
    assert len(points) > 5
    assert nearest_surfaces(model, points, normals) == pytest.approx(1e-3, abs=2e-5)


@pytest.mark.parametrize(
    "body", ["chassis", "wheel_rear_left", "base", "proximal2", "rod3", "platform", "ring"]
)
def test_robot_has_mujocos_surfaces(body: str) -> None:
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    check_on_surfaces(model, [model.body(body).id])


def test_payload_has_mujocos_surfaces() -> None:
    model = mujoco.MjModel.from_xml_path(str(payload_path("a")))
    check_on_surfaces(model, [model.body("payload").id], every=23)


def test_every_moving_body_of_the_robot_is_drawn() -> None:
    assert set(robot_shapes(omnid_design()).moving) == set(PATHS)


def test_another_design_is_drawn_with_its_own_lengths() -> None:
    design = replace(
        DESIGN, base_radius_m=0.25, proximal_length_m=0.3, rod_length_m=0.5, platform_radius_m=0.1
    )
    shapes = robot_shapes(design)
    link, rod = shapes.moving["proximal1"].triangles.vertices, shapes.moving["rod3"].triangles.vertices
    radius = 0.014, 0.006
    assert [link[:, 0].min(), link[:, 0].max()] == pytest.approx([-radius[0], 0.3 + radius[0]])
    assert [rod[:, 0].min(), rod[:, 0].max()] == pytest.approx([-radius[1], 0.5 + radius[1]])
    home = np.array([[[0.0, 0.0, 0.5]]])
    motion = body_motion(inverse_kinematics(home, design), np.zeros((1, 1, 3)), design)
    assert motion.wrist == pytest.approx(home)
    standing = shapes.standing.triangles.vertices
    plate = standing[np.abs(standing[:, 2] + 0.051125) < 0.0048]
    radii = np.linalg.norm(plate[:, :2], axis=1)
    assert np.isclose(radii, 0.20 + 0.07).sum() >= 48, "rims of the base plate"


@pytest.fixture(scope="module")
def trial(recording: Recording) -> ReplayTrial:
    return replay_trial(recording, "rec")


def views(content: rrb.Container | rrb.View) -> list[rrb.View]:
    if isinstance(content, rrb.View):
        return [content]
    return [view for part in content.contents for view in views(part)]


@pytest.fixture(scope="module")
def known() -> Recording:
    carried, units = uncalibrated(16.0)
    return knowing(carried.recording, units)


@pytest.fixture(scope="module")
def estimate(known: Recording) -> PayloadEstimate:
    return estimate_payload([known])


def gap_m(trial: ReplayTrial) -> float:
    assert trial.motion is not None
    return float(trial.motion.gap_position_m.max())


def test_flanges_meet_their_grasps(known: Recording, estimate: PayloadEstimate) -> None:
    bare = knowing(known, None)
    assert gap_m(replay_trial(known, "known", estimate)) < 1e-5
    # What an estimate was made of goes for a recording that does not say it itself ...
    assert gap_m(replay_trial(bare, "bare", estimate)) < 1e-5
    # ... and without either, robots are as designed.
    assert gap_m(replay_trial(bare, "bare", replace(estimate, units=None))) > 1e-3


def test_bases_are_drawn_as_they_stand(known: Recording, estimate: PayloadEstimate) -> None:
    trial, units = replay_trial(known, "known", estimate), known.metadata.units
    assert units is not None
    for R, tilt in zip(trial.bases.R_Wb, units.x[:, AT["tilt"]], strict=True):
        up = R.T @ [0.0, 0.0, 1.0]  # of the arm's own frame
        np.testing.assert_allclose(up, Rotation.from_rotvec([*-tilt, 0.0]).apply([0, 0, 1]), atol=1e-12)


def test_a_picture_has_the_wrists_of_robots_as_they_are(known: Recording, estimate: PayloadEstimate) -> None:
    """The platform of the drawn model, by MuJoCo's kinematics, is where the payload's grasp is."""
    import mujoco

    team = measured_team(known, estimate)
    assert team.R_W1 is not None
    assert team.p_W1 is not None
    assert estimate.grasps is not None
    data = mujoco.MjData(team.model)
    data.qpos[:] = team.qpos
    mujoco.mj_kinematics(team.model, data)
    for i, p_1i in enumerate(estimate.grasps.p_1i, start=1):
        flange = data.body(f"omnid{i}/flange").xpos
        np.testing.assert_allclose(flange, team.p_W1 + team.R_W1 @ p_1i, atol=1e-5)


def test_bodies_are_where_mujoco_puts_them(tmp_path) -> None:
    (log,) = serial.read_logs(write_log(tmp_path, made(seconds=2.0)), tmp_path / "arm.xml")
    model = serial.read_model(tmp_path / "arm.xml")
    drawn = joint_replay(model, log, "log")
    assert set(drawn.shapes) == {"turret", "upper", "fore"}
    data = mujoco.MjData(model.model)
    for k in (0, len(drawn.time) - 1):
        data.qpos[:] = log.q[np.argmin(np.abs(log.time - drawn.time[k]))]
        mujoco.mj_forward(model.model, data)
        for body in drawn.shapes:
            np.testing.assert_allclose(drawn.position[body][k], data.body(body).xpos, atol=1e-9)
            turn = Rotation.from_quat(drawn.quaternion[body][k]).as_matrix()
            np.testing.assert_allclose(turn.ravel(), data.body(body).xmat, atol=1e-9)


def test_torques_of_the_model_are_those_of_a_log_without_friction(tmp_path) -> None:
    write_model(tmp_path)
    write_map(tmp_path)
    values = made(seconds=4.0, heavier=1.0)
    time = values["time"]
    smooth = np.array([0.4, 0.3, 0.5]) * np.sin(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    rates = np.array([0.8, 0.9, 2.0]) * np.cos(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    bends = -np.array([1.6, 2.7, 8.0]) * np.sin(np.multiply.outer(time, [2.0, 3.0, 4.0]))
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    for k in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = smooth[k], rates[k], bends[k]
        mujoco.mj_inverse(model, data)
        for j, joint in enumerate(JOINTS):
            values[f"{joint} q"][k], values[f"{joint} torque"][k] = smooth[k, j], data.qfrc_inverse[j]
    (log,) = serial.read_logs(write_csv(tmp_path / "log.csv", values), tmp_path / "arm.xml")
    drawn = joint_replay(serial.read_model(tmp_path / "arm.xml"), log, "log")
    inner = slice(50, -50)
    asked = drawn.asked[inner]
    np.testing.assert_allclose(asked, log.torque[:: drawn.every][inner], atol=0.01 * np.abs(asked).max())


def test_a_model_that_shows_nothing_gets_bones(tmp_path) -> None:

    log = write_log(tmp_path, made(seconds=2.0))
    (tmp_path / "arm.xml").write_text(re.sub(r"<geom .*/>", "", MODEL), encoding="utf-8")
    (read,) = serial.read_logs(log, tmp_path / "arm.xml")
    drawn = joint_replay(serial.read_model(tmp_path / "arm.xml"), read, "log")
    upper = drawn.shapes["upper"].triangles.vertices
    assert upper[:, 2].max() == pytest.approx(0.4, abs=0.03)  # up to where the next body begins
    assert set(drawn.shapes) == {"turret", "upper", "fore"}
