"""Extended and calibrated models: what is written runs alike when it is read, in plain MuJoCo and in a trial."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mocobot
from effect_cases import example, one_robot, team_with
from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import inertia_parameters
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.errors import InputError
from estimator.files import LIST
from estimator.recording.model import Recording
from estimator.rigid_team import Bases
from invented_calibration import invented_calibration
from mocobot.api.simulation import SimulatedRecording
from mocobot.cli import main
from mocobot_sim.effects import EFFECTS
from mocobot_sim.effects.geometry import BaseTilt
from mocobot_sim.extended.extended import (
    calibrated_team,
    extra_of,
    load_extended,
    write_calibrated,
    write_extended,
)
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.models import base_height_m, omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted, resimulate
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

HIDDEN = (
    "phi_zero",
    "base_tilt",
    "grasp_flex",
    "joint_friction",
    "torque_lag",
    "sensor_lag",
    "clock_delay",
    "push",
    "drag",
    "slosh",
    "payload_mass",
)


def _hidden():
    effects = [example(cause, 2) for cause in HIDDEN]
    return effects, team_with("a", *effects)


@pytest.fixture
def folder(tmp_path):
    effects, scene = _hidden()
    write_extended(scene, effects, tmp_path / "model", {"note": "seen", "evidence": [1.0, 2.0]})
    return tmp_path / "model"


def test_it_runs_like_the_scene_it_came_from(folder):
    effects, scene = _hidden()
    loaded = load_extended(folder)
    assert loaded.effects == tuple(effects)
    assert loaded.effects == scene.effects
    assert loaded.grasp_slack_m == scene.grasp_slack_m
    assert loaded.grasp_slack_rad == (0.0,) * scene.robots
    trajectory = random_vias(scene.wrist_home_b, np.random.default_rng(0), 1)
    one, two = (predicted(run_trial(team, trajectory)) for team in (scene, loaded))
    for channel in ("phi", "theta", "tau"):
        np.testing.assert_allclose(getattr(two, channel), getattr(one, channel), rtol=0, atol=1e-12)
    assert extra_of(folder) == {"note": "seen", "evidence": [1.0, 2.0]}


def test_a_grasp_that_turns_is_kept_and_older_models_have_none(tmp_path):
    scene = team_with("a", example("grasp_flex", 2, turning_rad_per_N=1e-5, offset_m=0.05))
    write_extended(scene, scene.effects, tmp_path / "new", {})
    assert load_extended(tmp_path / "new").grasp_slack_rad == scene.grasp_slack_rad
    assert scene.grasp_slack_rad[1] > 0.0
    numbers = tmp_path / "new" / "effects.json"
    values = json.loads(numbers.read_text(encoding="utf-8"))
    del values["grasp_slack_rad"]
    numbers.write_text(json.dumps(values), encoding="utf-8")
    assert load_extended(tmp_path / "new").grasp_slack_rad == (0.0, 0.0, 0.0)


def test_plain_mujoco_loads_it(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "team.xml"))
    ours = _hidden()[1].compile()
    np.testing.assert_array_equal(model.body_mass, ours.body_mass)
    np.testing.assert_array_equal(model.eq_solref, ours.eq_solref)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=100)
    assert np.isfinite(data.qpos).all()
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert all(f"`{cause}`" in text for cause in HIDDEN)
    assert sorted(path.name for path in folder.iterdir()) == [LIST, "README.md", "effects.json", "team.xml"]


@pytest.mark.parametrize("cause", list(EFFECTS))
def test_every_cause_is_kept(cause, tmp_path):
    effect = example(cause)
    write_extended(one_robot(tmp_path, effect), [effect], tmp_path / "model", {})
    loaded = load_extended(tmp_path / "model")
    assert loaded.effects == (effect,)
    assert loaded.robots == 1


def test_a_mesh_travels_with_the_model(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    lines = ["v " + " ".join(map(str, p)) for p in points] + [
        "f " + " ".join(str(k + 1) for k in f) for f in faces
    ]
    (tmp_path / "corner.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "meshy.xml").write_text(
        '<mujoco><compiler angle="radian"/><asset><mesh name="m" file="corner.obj"/></asset><worldbody>'
        '<body name="payload"><inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/><site name="grasp1"/>'
        '<geom type="mesh" mesh="m" mass="0"/></body></worldbody></mujoco>'
    )
    write_extended(build_team(tmp_path / "meshy.xml"), [], tmp_path / "model", {})
    (tmp_path / "corner.obj").unlink()
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "model" / "team.xml")).nmesh == 1
    assert load_extended(tmp_path / "model").compile().nmesh == 1


def test_an_old_model_is_replaced_and_anything_else_is_not(folder):
    write_extended(build_team("b"), [], folder, {})
    assert load_extended(folder).effects == ()
    assert [path.name for path in folder.parent.iterdir()] == ["model"], "no scraps"
    other = folder.parent / "mine"
    other.mkdir()
    (other / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="mine: exists and is not an extended model; name a new folder"):
        write_extended(build_team("b"), [], other, {})
    assert (other / "thesis.txt").is_file()
    with pytest.raises(InputError, match="cannot be written as JSON"):
        write_extended(build_team("b"), [], folder, {"x": float("nan")})
    with pytest.raises(InputError, match=r"thesis.txt/model: cannot be written"):
        write_extended(build_team("b"), [], other / "thesis.txt" / "model", {})


def _change(folder, change):
    path = folder / "effects.json"
    values = json.loads(path.read_text())
    change(values)
    path.write_text(json.dumps(values))


BAD = {
    "format": (lambda v: v.update(format="x"), "format and version are 'x' and 1; this program reads"),
    "version": (lambda v: v.update(version=2), "format and version are 'mocobot-extended-model' and 2"),
    "unknown": (lambda v: v.update(mood=1), "unknown key 'mood'; the keys are format, version, robots"),
    "missing": (lambda v: v.pop("grasps"), "missing key 'grasps'"),
    "robots": (lambda v: v.update(robots=0), "robots is 0; it must be a whole number of at least 1"),
    "another team": (lambda v: v.update(robots=2), "must be 2 x 3 finite numbers"),
    "effect": (lambda v: v["effects"][0].update(cause="rust"), "cause 'rust' does not exist"),
    "text": (lambda v: v["theta_home_rad"][0].__setitem__(0, "1"), "theta_home_rad is .* finite numbers"),
    "unit": (lambda v: v["as_built"][1].pop("tau_zero_Nm"), r"as_built\[2\]: missing key 'tau_zero_Nm'"),
    "sensors": (
        lambda v: v["sensors"].update(torque_lag_s=[0.0]),
        "sensors: torque_lag_s is .* must be 3 finite",
    ),
    "pose": (
        lambda v: v["mounts"][0].update(quaternion_wxyz=[1, 1, 0, 0]),
        r"mounts\[1\]: quaternion_wxyz has not",
    ),
    "initial": (lambda v: v.update(initial={"phi_rad": 1}), "initial: missing key 'theta_rad'"),
    "extra": (lambda v: v.update(extra=1), "extra is 1; it must be an object"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_numbers_are_refused_in_one_sentence(folder, case):
    change, sentence = BAD[case]
    _change(folder, change)
    with pytest.raises(InputError, match=sentence) as caught:
        load_extended(folder)
    assert "effects.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bad_files_are_refused(folder, tmp_path):
    with pytest.raises(InputError, match=r"nowhere/effects\.json: cannot be read"):
        load_extended(tmp_path / "nowhere")
    (folder / "team.xml").write_text("<mujoco/>")
    with pytest.raises(InputError, match=r"team\.xml: not the MJCF of a team|has 0 robots"):
        load_extended(folder)
    (folder / "effects.json").write_text('{"robots": NaN}')
    with pytest.raises(InputError, match=r"effects\.json: not valid JSON \(NaN is not a JSON number"):
        load_extended(folder)
    (folder / "effects.json").write_text('{"robots": 1, "robots": 2}')
    with pytest.raises(InputError, match="key 'robots' appears twice"):
        load_extended(folder)
    (folder / "team.xml").unlink()
    (folder / "effects.json").write_bytes(b"\xff")
    with pytest.raises(InputError, match="cannot be read"):
        load_extended(folder)


def test_command_line_simulates_a_model(folder, tmp_path, capsys):
    out = tmp_path / "rec.parquet"
    main(["simulate", "--model", str(folder), "--vias", "1", "--preset", "ideal", "--out", str(out)])
    assert "ideal sensors" in capsys.readouterr().out
    truth = json.loads((tmp_path / "rec.truth.json").read_text())
    assert [effect["cause"] for effect in truth["effects"]] == list(HIDDEN)
    assert truth["mass_kg"] == 11.672


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--payload", "a"], "--payload and --model are both given"),
        (["--preset", "uncalibrated"], "preset 'uncalibrated' draws robots of its own"),
    ],
)
def test_command_line_refuses_what_contradicts_a_model(folder, tmp_path, capsys, options, sentence):
    with pytest.raises(SystemExit) as caught:
        main(["simulate", "--model", str(folder), "--out", str(tmp_path / "rec.parquet"), *options])
    assert caught.value.code == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "rec.parquet").exists()


def test_masses_of_the_arms_are_kept_and_may_be_missing(tmp_path):
    units = CalibrationSpread(geometry_m=1e-3, arm_mass_ratio=0.05).draw(3, np.random.default_rng(2))
    write_extended(build_team("a", units), [], tmp_path / "model", {})
    loaded = load_extended(tmp_path / "model")
    assert [unit.to_dict() for unit in loaded.units] == [unit.to_dict() for unit in units]
    assert loaded.units[1].wrist_mass_ratio
    masses = ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio")
    _change(tmp_path / "model", lambda v: [unit.pop(name) for unit in v["as_built"] for name in masses])
    older = load_extended(tmp_path / "model")
    zero = dict(zip(masses, (np.zeros(3), np.zeros(3), 0.0), strict=True))
    assert older.units[1].to_dict() == replace(units[1], **zero).to_dict()


TILTED = BaseTilt(2, 0.01, -0.02)


def exact(truth: mocobot.GroundTruth, tilted: BaseTilt) -> Calibration:
    """The calibration that a perfect fit would give."""
    invented = invented_calibration(3)
    x = np.zeros((3, COUNT))
    for robot, unit in enumerate(truth.units):
        x[robot] = np.concatenate(
            [
                unit.phi_zero_rad, unit.theta_zero_rad, unit.base_radius_m - unit.platform_radius_m,
                unit.proximal_length_m, unit.rod_length_m, unit.stiffness_ratio, unit.tau_zero_Nm, np.zeros(2),
                unit.proximal_mass_ratio, unit.rod_mass_ratio, [unit.wrist_mass_ratio],
            ]
        )  # fmt: skip
    units = ArmUnit(omnid_design(), x)
    units.of("tilt")[tilted.robot - 1] = tilted.roll_rad, tilted.pitch_rad
    c, m = truth.p_1c, truth.mass_kg
    about_c = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    J = about_c + m * (c @ c * np.eye(3) - np.outer(c, c))
    held = invented.payloads[0]
    grasps = replace(held.grasps, R_1i=truth.R_1i, p_1i=truth.p_1i)
    payload = CalibratedPayload(
        "b", grasps, np.r_[m, m * c, inertia_parameters(J)], held.covariance, held.by_scale
    )
    # {b} of every robot in {b1}; a tilted chassis turns about its mount on the floor.
    mounts = build_team("b").mounts
    top = np.array([0.0, 0.0, base_height_m()])
    lean = [tilted.tilt if robot == tilted.robot else Rotation.identity() for robot in (1, 2, 3)]
    at = np.array(
        [X.translation + X.rotation.apply(one.apply(top)) for X, one in zip(mounts, lean, strict=True)]
    )
    R1 = mounts[0].rotation
    bases = Bases((R1.inv() * mounts.rotation).as_matrix(), R1.inv().apply(at - at[0]))
    trials = tuple(replace(t, bases=bases) for t in invented.trials if t.payload is not None)
    return replace(invented, units=units, payloads=(payload,), trials=trials)


@pytest.fixture(scope="module")
def recording() -> SimulatedRecording:
    return mocobot.simulate("b", "periodic", duration_s=4.0, preset=UNCALIBRATED, seed=4, effects=[TILTED])


UNCALIBRATED = replace(
    mocobot.PRESETS["uncalibrated"],
    name="test",
    spread=replace(mocobot.PRESETS["uncalibrated"].spread, arm_mass_ratio=0.05),
)


def apart(recording: Recording, scene: mocobot.TeamScene) -> dict[str, float]:
    """rms of recorded minus simulated readings, after the take-up phase."""
    simulated = predicted(resimulate(recording, scene))
    late = recording.time > 4.0
    assert late.sum() > 200
    return {
        name: float(np.sqrt(np.mean((getattr(recording, name) - getattr(simulated, name))[late] ** 2)))
        for name in ("phi", "theta", "tau")
    }


def test_it_reads_like_the_team_that_was_calibrated(recording: SimulatedRecording, tmp_path: Path) -> None:
    made = exact(recording.truth, TILTED)
    write_calibrated(made, tmp_path / "model")
    calibrated = apart(recording, load_extended(tmp_path / "model"))
    level = replace(made, units=replace(made.units, x=np.zeros((3, COUNT))))
    designed = apart(recording, calibrated_team(level))
    # Encoders step by 0.1 mrad, torques have 2 mN m of noise.
    assert calibrated["phi"] < 3e-4, calibrated
    assert calibrated["theta"] < 2e-4, calibrated
    assert calibrated["tau"] < 0.02, calibrated
    for name, left in calibrated.items():
        assert left < 0.05 * designed[name], (name, calibrated, designed)
    assert extra_of(tmp_path / "model") == {"calibrated": True, "payload": "b"}


def test_what_no_model_can_be_made_of() -> None:
    made = invented_calibration(2)
    with pytest.raises(InputError, match="no recording of a payload number 2"):
        calibrated_team(made, 1)
    other = replace(made, units=ArmUnit(replace(made.design, gravity_mps2=1.6), made.units.x))
    with pytest.raises(InputError, match="of another design than the simulated Omnid"):
        calibrated_team(other)
