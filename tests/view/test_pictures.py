"""Pictures: where points lie, bodies where MuJoCo has them, marks at the truth, and words for all of it."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from discrepancy.result.read import NamedCause
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import MassEstimate
from mocobot_sim.base.drive import build_solo, compile_solo
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.truth import GroundTruth
from mocobot_view import colours
from mocobot_view import render as render_module
from mocobot_view.camera import (
    Camera,
    Marks,
    pixels,
)
from mocobot_view.payload import BodyFacts, Grasps
from mocobot_view.pictures import (
    FOVY,
    MeasuredTeam,
    diagnosis_shot,
    estimate_shot,
    estimate_view,
    measured_team,
    team_shot,
    team_view,
)
from mocobot_view.render import Shot, render, render_shots
from replay_case import BODIES, Placed, made, payload_body, placed_trial, robot_body, true_estimate

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
VIEW = Camera((0.0, 0.0, 0.3), 2.0, 215.0, -30.0)


def test_without_a_renderer_there_is_a_sentence(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    words = render(compile_solo(build_solo()), [np.zeros(0)], VIEW)
    assert isinstance(words, str)
    assert words.startswith("pictures are skipped: MuJoCo cannot render without a screen here (disabled: ")
    assert "\n" not in words


def test_pictures_show_the_states_and_the_marks():
    model = compile_solo(build_solo())
    aside = model.qpos0.copy()
    aside[0] += 0.3
    marks = Marks()
    marks.path([[-0.5, -0.5, 0.01], [0.5, -0.5, 0.01], [0.5, 0.5, 0.01]], 0.02, (0.0, 0.8, 0.0, 1.0))
    marks.arrow([0.0, 0.0, 0.9], [0.0, 0.5, 0.9], 0.03, (0.0, 0.0, 1.0, 1.0))
    states = [model.qpos0, aside, model.qpos0]
    plain, moved, marked = made(render(model, states, VIEW, [Marks(), Marks(), marks], 320, 240))
    assert plain.shape == (240, 320, 3)
    assert np.abs(plain - moved).max() > 50
    for colour in (1, 2):
        others = [k for k in range(3) if k != colour]
        pure = lambda p, k=colour, o=others: (p[..., k] > 120) & (p[..., o].max(axis=-1) < 80)  # noqa: E731
        assert pure(marked).sum() > 50
        assert not pure(plain).any()


@pytest.mark.slow
def test_the_square_is_driven_without_any_opengl(tmp_path):
    done = subprocess.run(
        [sys.executable, str(SCENARIOS / "drive_square.py"), "--out", str(tmp_path), "--pace", "1"],
        env=os.environ | {"MUJOCO_GL": "disabled"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "kinematics with rollers" in done.stdout
    assert done.stdout.count("turn 360 deg") == 3
    assert "pictures are skipped" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["drive_square.png"]


@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("carry_sideways.py", ("--payload", "z"), "payload 'z' does not exist"),
        ("guided_by_hand.py", ("--estimate", "nowhere.json"), "nowhere.json: not a usable estimate"),
        ("drive_square.py", ("--pace", "0"), "must last longer than 0 s"),
    ],
)
def test_scenarios_refuse_bad_input_in_one_sentence(tmp_path, monkeypatch, capsys, name, options, sentence):
    monkeypatch.setattr(sys, "argv", [name, *options, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        runpy.run_path(str(SCENARIOS / name), run_name="__main__")
    assert stop.value.code == 2
    assert sentence in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    "name", sorted(path.name for path in SCENARIOS.glob("*.py") if "argparse" in path.read_text())
)
def test_scenarios_that_take_arguments_tell_of_them_and_write_nothing(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as stop:
        runpy.run_path(str(SCENARIOS / name), run_name="__main__")
    assert stop.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: {name}")
    assert list(tmp_path.iterdir()) == []


EMPTY = "<mujoco><visual><global fovy='30'/></visual><worldbody><light pos='0 0 5'/></worldbody></mujoco>"


def test_points_lie_where_mujoco_draws_them() -> None:
    points = np.array([[0.3, -0.2, 0.1], [-0.4, 0.35, 0.6], [0.0, 0.0, 0.0], [1.1, 0.7, -0.3]])
    camera, width, height = Camera((0.1, 0.0, 0.2), 3.0, 70.0, -25.0), 480, 360
    marks = []
    for point in points:
        marks.append(Marks())
        marks[-1].ellipsoid(point, 0.04, (1.0, 1.0, 1.0, 1.0))
    model = mujoco.MjModel.from_xml_string(EMPTY)
    pictures = made(render(model, [np.zeros(0)] * len(points), camera, marks, width, height))
    for picture, at in zip(pictures, pixels(camera, points, width, height, 30.0), strict=True):
        rows, columns = np.nonzero(picture.max(axis=-1) > 40)
        assert len(rows) > 50
        middle = 0.5 * np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1])
        assert middle == pytest.approx(at, abs=1.0)


FRICTION = NamedCause(
    "joint_friction", 2, 3, "It rubs.", "friction in a driven joint", "friction in joint 3 of robot 2"
)
ASPECT, WIDTH, HEIGHT = 1.6, 480, 300


@pytest.fixture(scope="module")
def placed_a(team_a: TeamScene) -> Placed:
    return placed_trial(team_a)


def truth_of(placed: Placed) -> BodyFacts:
    true = GroundTruth.of(placed.scene)
    return BodyFacts(Grasps(true.R_1i, true.p_1i), true.mass_kg, true.p_1c, true.R_1c, true.principal_kgm2)


def whole_estimate(placed: Placed) -> PayloadEstimate:
    """True grasps, mass and centre of mass; no inertia."""
    true = GroundTruth.of(placed.scene)
    return replace(
        true_estimate(placed.scene),
        mass=MassEstimate(true.mass_kg, 0.01, 0.1),
        p_1c=np.array(true.p_1c),
        p_1c_covariance=np.eye(3) * 1e-8,
    )


def poses(team: MeasuredTeam) -> tuple[RigidTransform, list[str]]:
    data = mujoco.MjData(team.model)
    data.qpos[:] = team.qpos
    mujoco.mj_kinematics(team.model, data)
    turns = Rotation.from_quat(data.xquat, scalar_first=True)
    names = [team.model.body(b).name for b in range(team.model.nbody)]
    return RigidTransform.from_components(data.xpos, turns), names


def check_bodies(placed: Placed, team: MeasuredTeam, sample: int, within_m: float) -> None:
    """Every body against robot 1's base, as MuJoCo had it in the trial."""
    found, names = poses(team)
    home = robot_body(placed, 1, "base")[sample].inv(), found[names.index("omnid1/base")].inv()
    pairs = [
        (robot_body(placed, i, body), f"omnid{i}/{body}")
        for i in range(1, placed.scene.robots + 1)
        for body in BODIES
    ]
    if team.has_cad:
        pairs.append((payload_body(placed), "payload/payload"))
    for true, name in pairs:
        apart = (home[0] * true[sample]).inv() * (home[1] * found[names.index(name)])
        assert np.linalg.norm(apart.translation) < within_m, name
        assert apart.rotation.magnitude() < 5.0 * within_m, name


@pytest.mark.parametrize("share", [0.0, 0.37, 1.0])
def test_bodies_are_where_mujoco_had_them(placed_a: Placed, share: float) -> None:
    recording = placed_a.recording(payload="a")
    sample = round(share * (len(recording.time) - 1))
    time_s = float(recording.time[sample] - recording.time[0])
    team = measured_team(recording, true_estimate(placed_a.scene), time_s=time_s)
    assert team.has_cad
    assert team.notes == ()
    assert team.time_s == pytest.approx(time_s)
    check_bodies(placed_a, team, sample, 3e-6)


def test_marks_are_at_the_payloads_truth(placed_a: Placed) -> None:
    """Centre of mass and grasp frames against MuJoCo's own sites of the payload in the model."""
    truth = truth_of(placed_a)
    recording = placed_a.recording(payload="a")
    shot = estimate_shot(recording, whole_estimate(placed_a), truth)
    data = mujoco.MjData(shot.model)
    data.qpos[:] = shot.qpos
    mujoco.mj_kinematics(shot.model, data)
    centres = [row[:3] for row in shot.marks.ellipsoids]
    assert len(centres) == 2
    for centre in centres:
        assert centre == pytest.approx(data.site("payload/com").xpos, abs=2e-6)
    arrows = np.array(shot.marks.arrows).reshape(2, 3, 3, 11)  # estimate and truth, grasp, axis
    for i in range(3):
        site = data.site(f"payload/grasp{i + 1}")
        for k in range(3):
            start, end = arrows[0, i, k, :3], arrows[0, i, k, 3:6]
            assert start == pytest.approx(site.xpos, abs=2e-5)
            along = (end - start) / np.linalg.norm(end - start)
            assert along == pytest.approx(site.xmat.reshape(3, 3)[:, k], abs=2e-5)
    assert len(shot.marks.lines) == 3 * 72
    # The ellipsoid's three ellipses: where they cross its axes they are as far out as a solid body's of that inertia.
    ends = np.array(shot.marks.lines)[:, :3] - data.site("payload/com").xpos
    axes = data.site("payload/com").xmat.reshape(3, 3)
    a, b, c = np.abs(ends @ axes).max(axis=0)
    mass, inertia = truth.mass_kg, truth.principal_kgm2
    assert mass / 5.0 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]) == pytest.approx(inertia, rel=1e-3)


def test_words_say_what_is_shown_and_what_is_not_known(placed_a: Placed) -> None:
    recording = placed_a.recording(payload="a")
    whole = estimate_shot(recording, whole_estimate(placed_a), truth_of(placed_a))
    assert "centre of mass." in whole.says
    assert "Green and thin: the truth." in whole.says
    assert "bars" not in whole.says
    other = estimate_shot(placed_a.recording(payload="mine"), true_estimate(placed_a.scene))
    assert "bars stand for the payload" in other.says
    assert "Magenta" not in other.says
    assert len(other.marks.lines) == 3
    wrong = estimate_shot(placed_a.recording(payload="c"), true_estimate(placed_a.scene))
    assert "The geometry of payload 'c' is not drawn: grasp" in wrong.says
    unknown = replace(true_estimate(placed_a.scene), grasps=None)
    row = estimate_shot(recording, unknown)
    assert "drawn in a row, without a payload" in row.says
    assert not row.marks.arrows
    assert diagnosis_shot(recording, whole_estimate(placed_a), [FRICTION]).says.endswith(
        "Red: friction in joint 3 of robot 2 (omnid2, proximal3)."
    )


def test_causes_are_red_where_they_sit(placed_a: Placed) -> None:
    recording, estimate = placed_a.recording(payload="a"), whole_estimate(placed_a)
    causes = [FRICTION, NamedCause("sea_bias", 2, 3, ""), NamedCause("payload_mass", None, None, ""),
              NamedCause("base_tilt", 3, None, "")]  # fmt: skip
    shot = diagnosis_shot(recording, estimate, causes)
    data = mujoco.MjData(shot.model)
    data.qpos[:] = shot.qpos
    mujoco.mj_kinematics(shot.model, data)
    where = [data.body("omnid2/proximal3").xpos, data.site("payload/com").xpos, data.body("omnid3/base").xpos]
    assert [row[:3] for row in shot.marks.ellipsoids] == [pytest.approx(p, abs=2e-6) for p in where]
    assert [label.text for label in shot.marks.labels] == [
        "omnid1", "omnid2", "omnid3", "friction in a driven joint, sea_bias", "payload_mass", "base_tilt"
    ]  # fmt: skip
    red = np.array(colours.FAULT) / 255.0
    is_red = np.abs(shot.model.geom_rgba[:, :3] - red).max(axis=1) < 1e-6
    guilty = {shot.model.body(b).name for b in shot.model.geom_bodyid[is_red]}
    assert guilty == {"omnid2/proximal3", "payload/payload", "omnid3/base"}
    bars = diagnosis_shot(placed_a.recording(payload=None), estimate, causes)
    assert np.array(bars.marks.lines)[:, 7:10] == pytest.approx(np.tile(red, (3, 1)))


def test_refusals(placed_a: Placed, teams: dict[int, TeamScene]) -> None:
    recording = placed_a.recording()
    with pytest.raises(InputError, match="the estimate is of 2 robots; rec is of 3 robots"):
        estimate_shot(recording, true_estimate(teams[2]))
    with pytest.raises(InputError, match="the diagnosis names robot 4; rec is of 3 robots"):
        diagnosis_shot(recording, true_estimate(placed_a.scene), [replace(FRICTION, robot=4)])
    with pytest.raises(InputError, match="payload 'z' does not exist"):
        estimate_shot(recording, true_estimate(placed_a.scene), payload="z")
    with pytest.raises(InputError, match="payload 'z' does not exist"):
        team_view("z")


def test_everything_is_in_the_picture(placed_a: Placed) -> None:
    for shot in (
        *(team_shot(payload, ASPECT) for payload in "abcd"),
        estimate_shot(placed_a.recording(payload="a"), whole_estimate(placed_a), truth_of(placed_a)),
    ):
        data = mujoco.MjData(shot.model)
        data.qpos[:] = shot.qpos
        mujoco.mj_kinematics(shot.model, data)
        marks = shot.marks.points()
        at = pixels(shot.camera, np.concatenate([data.geom_xpos, marks]), ASPECT, 1.0, FOVY)
        planes = shot.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        inside = ((at > 0) & (at < [ASPECT, 1.0])).all(axis=1)
        assert inside[: shot.model.ngeom][~planes].all()
        assert inside[shot.model.ngeom :].all()


def pictures_or_skip(shots: list[Shot]) -> list[np.ndarray]:
    return made(render_shots(shots, WIDTH, HEIGHT))


@pytest.mark.slow
def test_pictures_show_it_all_and_are_made_in_one_process(
    placed_a: Placed, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, estimate = placed_a.recording(payload=None), whole_estimate(placed_a)
    shots = [
        team_shot("a"), estimate_shot(recording, estimate), diagnosis_shot(recording, estimate, [FRICTION])
    ]  # fmt: skip
    calls = []
    run = subprocess.run
    monkeypatch.setattr(render_module.subprocess, "run", lambda *a, **k: (calls.append(a), run(*a, **k))[1])
    team, estimated, diagnosed = pictures_or_skip(shots)
    assert len(calls) == 1
    for picture in (team, estimated, diagnosed):
        assert picture.shape == (HEIGHT, WIDTH, 3)
        assert picture.std() > 20.0
        assert picture.min() < 60
        assert picture.max() > 200

    def near(picture: np.ndarray, shot: Shot, which: int, colour: colours.Colour) -> int:
        """Pixels of about a colour within 12 pixels of an ellipsoid's centre."""
        x, y = pixels(shot.camera, shot.marks.ellipsoids[which][:3], WIDTH, HEIGHT, FOVY)[0]
        part = picture[max(0, int(y) - 12) : int(y) + 12, max(0, int(x) - 12) : int(x) + 12]
        # Light changes a colour's strength, not which of its parts leads.
        target = np.array(colour) / max(colour)
        shown = part / np.maximum(part.max(axis=-1, keepdims=True), 1)
        return int((np.abs(shown - target).max(axis=-1) < 0.25).sum())

    assert near(estimated, shots[1], 0, colours.ESTIMATE) > 10
    assert near(estimated, shots[1], 0, colours.FAULT) < near(estimated, shots[1], 0, colours.ESTIMATE)
    assert near(diagnosed, shots[2], 0, colours.FAULT) > 30
    assert near(estimated, shots[2], 0, colours.FAULT) < 5


@pytest.mark.slow
def test_views_are_pictures_or_one_sentence(placed_a: Placed, monkeypatch: pytest.MonkeyPatch) -> None:
    recording, estimate = placed_a.recording(payload="a"), whole_estimate(placed_a)

    def views() -> list[np.ndarray | str]:
        return [
            team_view("b", 160, 100),
            estimate_view(recording, estimate, 160, 100, truth=truth_of(placed_a), time_s=1.0),
        ]

    for view in views():
        assert made(view if isinstance(view, str) else [view])[0].shape == (100, 160, 3)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    for view in views():
        assert isinstance(view, str)
        assert view.startswith("pictures are skipped: MuJoCo cannot render without a screen here (disabled: ")
        assert view.endswith("unset MUJOCO_GL to have EGL and OSMesa tried")


def test_without_any_renderer_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(render_module, "RENDERERS", ("disabled", "nonsense"))
    view = team_view("a", 160, 100)
    assert isinstance(view, str)
    assert "\n" not in view
    assert "disabled: " in view
    assert "nonsense: " in view
    assert view.endswith("install EGL (Debian and Ubuntu: libegl1) or OSMesa (libosmesa6)")
