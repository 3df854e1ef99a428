"""A whole trial, and a recording commanded again: rows of one instant, honest physics, clear failures."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from closed_loop import ClosedLoop, base_poses
from effect_cases import example, team_with
from estimator.errors import InputError
from estimator.recording.parquet import read_recording, write_recording
from mocobot_sim.control.control import ControlGains
from mocobot_sim.errors import TrialError
from mocobot_sim.kernels import wrist
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.models import base_height_m, omnid_design
from mocobot_sim.scene.payload import payload_mjcf
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial import trial as trial_module
from mocobot_sim.trial.resimulate import predicted, resimulate
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import Trajectory, random_vias, sphere_motion, static_orientations
from mocobot_sim.trial.trial import between_commands, run_trial
from mocobot_sim.trial.trial_log import Rows
from mocobot_sim.trial.truth import GroundTruth
from payload_mjcf import TWO

REACH, PROXIMAL, ROD = 0.18 - 0.062, 0.200, 0.368
ROBOTS = pytest.mark.parametrize("robots", [1, 2, 5])


def _short(scene: TeamScene, seed: int = 0, vias: int = 2, box_m=(0.03, 0.03, 0.03)) -> Trajectory:
    return random_vias(scene.wrist_home_b, np.random.default_rng(seed), vias, box_m=box_m)


def _still(scene: TeamScene, samples: int = 150) -> Trajectory:
    return Trajectory("random", np.tile(scene.wrist_home_b, (samples, 1, 1)))


def _arrays(log) -> dict[str, np.ndarray]:
    return {
        entry.name: getattr(log, entry.name)
        for entry in dataclasses.fields(log)
        if isinstance(getattr(log, entry.name), np.ndarray)
    }


def _wrists_from_payload(scene: TeamScene, log) -> np.ndarray:
    """Wrist positions in {b} that the payload's logged pose implies, shape (Q, N, 3)."""
    p_Wb, R_Wb = base_poses(scene)
    p_Wi = log.p_W1[:, None] + np.einsum("qij,nj->qni", log.R_W1, scene.X_1i.translation)
    return np.einsum("nji,qnj->qni", R_Wb, p_Wi - p_Wb)


def _wrists_from_phi(phi: np.ndarray) -> np.ndarray:
    rows = [wrist(angles, REACH, PROXIMAL, ROD)[0] for angles in phi.reshape(-1, 3)]
    return np.array(rows).reshape(phi.shape)


def _check_one_instant(scene, log) -> None:
    implied = _wrists_from_payload(scene, log)
    step_m = np.linalg.norm(np.gradient(implied, axis=0), axis=-1).max() / 10
    difference = np.linalg.norm(_wrists_from_phi(log.phi) - implied, axis=-1)
    assert step_m > 0.1e-3, "one millisecond of motion"
    assert difference.max() < 0.01e-3
    _, R_Wb = base_poses(scene)
    R_1i = scene.X_1i.rotation.as_matrix()
    worst = 0.0
    for i in range(log.robots):
        R_bi = Rotation.from_matrix(R_Wb[i].T @ log.R_W1 @ R_1i[i])
        gimbal = Rotation.from_euler("ZYX", log.theta[:, i])
        worst = max(worst, (gimbal.inv() * R_bi).magnitude().max())
    assert worst < np.deg2rad(0.0005)


def test_every_row_is_one_instant(team_a, random_a):
    """Encoders of all robots and the payload's pose agree thirty times better than 1 ms of motion would allow."""
    _check_one_instant(team_a, random_a)
    assert random_a.time[1] == 0.01
    assert len(random_a.time) == len(random_a.ref_b)
    np.testing.assert_allclose(np.diff(random_a.time), 0.01, rtol=0, atol=1e-9)


def test_torque_is_the_springs_deflection_of_the_same_row(monkeypatch, tmp_path):
    """Stiffness as built, deflection from MuJoCo's own hinge angle in the row's state."""
    units = CalibrationSpread(stiffness_ratio=0.05).draw(2, np.random.default_rng(1))
    scene = build_team(TWO.write(tmp_path), units)
    states = []
    before_step = Rows.before_step

    def spy(self, sample):
        states.append(self.data.qpos.copy())
        before_step(self, sample)

    monkeypatch.setattr(Rows, "before_step", spy)
    log = run_trial(scene, _short(scene))
    model = scene.compile()
    assert len(states) == len(log.time)
    for i, unit in enumerate(units):
        for k in range(3):
            motor, spring = (
                np.array(states)[:, model.joint(f"omnid{i + 1}/{name}{k + 1}").qposadr[0]]
                for name in ("motor", "spring")
            )
            tau = -100.0 * (1.0 + unit.stiffness_ratio[k]) * spring
            np.testing.assert_allclose(log.tau[:, i, k], tau, rtol=0, atol=1e-12)
            phi = 0.6230299772752583 + motor + spring
            np.testing.assert_allclose(log.phi[:, i, k], phi, rtol=0, atol=1e-12)
    assert np.ptp(log.tau, axis=0).min() > 0.5


@ROBOTS
def test_teams_of_any_size_run(teams, robots):
    scene = teams[robots]
    done = []
    log = run_trial(scene, _short(scene), progress=lambda *now: done.append(now))
    assert log.robots == robots
    assert log.phi.shape == log.theta.shape == log.tau.shape == log.ref_b.shape == (len(log.time), robots, 3)
    assert done[0] == (0, len(log.time))
    assert done[1:] == [(now, len(log.time)) for now in [*range(100, len(log.time), 100), len(log.time)]]
    for name, values in _arrays(log).items():
        assert np.isfinite(values).all(), name
    assert np.ptp(log.phi, axis=0).min() > 0.01
    assert log.rod_error_m < 0.02e-3
    assert log.weld_error_m < 0.01e-3
    assert np.rad2deg(log.weld_error_rad) < 0.001
    # Back at home; one or two grasps may leave the payload swinging and pulling.
    end = np.linalg.norm(_wrists_from_phi(log.phi[-1]) - scene.wrist_home_b, axis=-1)
    assert end.max() < (0.1e-3 if robots == 5 else 10e-3)


def test_same_seed_same_bits(teams):
    scene = teams[2]
    one, two = (_arrays(run_trial(scene, _short(scene, seed=4))) for _ in range(2))
    assert len(one) == 8
    for name, values in one.items():
        np.testing.assert_array_equal(values, two[name], err_msg=name)
    other = run_trial(scene, _short(scene, seed=5))
    assert other.phi.shape != one["phi"].shape or np.any(other.phi != one["phi"])


def test_commands_between_samples_pass_through_the_samples(random_a):
    """Ten ticks per sample; a minimum-jerk polynomial is smooth enough for the spline to hit it in between."""
    ref, rate = between_commands(random_a.ref_b, 10)
    assert ref.shape == rate.shape == (10 * len(random_a.ref_b), 3, 3)
    np.testing.assert_allclose(ref[::10], random_a.ref_b, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(ref[-9:], np.tile(ref[-1], (9, 1, 1)))
    np.testing.assert_allclose(np.gradient(ref, 1e-3, axis=0)[1:-10], rate[1:-10], rtol=0, atol=2e-4)
    # Nothing between two samples strays from them: no overshoot where a wrist dwells.
    low = np.minimum(random_a.ref_b[:-1], random_a.ref_b[1:]) - 1e-5
    high = np.maximum(random_a.ref_b[:-1], random_a.ref_b[1:]) + 1e-5
    between = ref[:-10].reshape(-1, 10, 3, 3)
    assert np.all((between >= low[:, None]) & (between <= high[:, None]))


# Physics, from MuJoCo's state alone


def test_flange_forces_move_the_payload(team_a):
    """Newton at every step: the robots' forces add up to m (a - g), a from the path of the centre of mass."""
    loop = ClosedLoop(team_a)
    ref, rate = between_commands(_short(team_a, vias=3, box_m=(0.05, 0.05, 0.03)).ref_b, 10)
    payload, mass = loop.index.payload_body, 11.672
    path, forces = [], []
    for tick in range(2500, 4500):
        loop.controller.update(ref[tick], rate[tick])
        mujoco.mj_step(loop.model, loop.data)
        # A step leaves frames and forces at the state it started from.
        path.append(loop.data.xipos[payload].copy())
        forces.append(loop.forces_on_payload().sum(axis=0))
    acceleration = np.diff(path, n=2, axis=0) / 1e-6
    expected = mass * (acceleration + np.array([0, 0, 9.81]))
    assert np.abs(acceleration).max() > 0.3
    np.testing.assert_allclose(forces[1:-1], expected, rtol=0, atol=0.1)


def test_motors_pay_for_all_the_energy(team_a):
    """No friction, no damping anywhere: kinetic + gravity + spring energy changes by the motors' work."""
    scene = team_a
    loop = ClosedLoop(scene)
    loop.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    ref, rate = between_commands(_short(scene, vias=3, box_m=(0.05, 0.05, 0.03)).ref_b, 10)
    work, paid, energy = 0.0, [], []
    for tick in range(2000, 6000):
        loop.controller.update(ref[tick], rate[tick])
        before = loop.data.qvel[loop.index.motor_dof].copy()
        mujoco.mj_step(loop.model, loop.data)
        energy.append(loop.data.energy.sum())
        paid.append(work)
        mean_rate = 0.5 * (before + loop.data.qvel[loop.index.motor_dof])
        work += 1e-3 * np.sum(loop.data.ctrl[loop.index.actuator] * mean_rate)
    gained = np.array(energy) - energy[0]
    assert np.ptp(gained) > 1.0
    np.testing.assert_allclose(gained, paid, rtol=0, atol=0.02 * np.ptp(gained))


# What must fail


def _design(monkeypatch, **changes) -> None:
    design = dataclasses.replace(omnid_design(), **changes)
    monkeypatch.setattr(trial_module, "omnid_design", lambda: design)


def test_an_open_weld_fails_the_trial():
    scene = build_team("a")
    scene.root.find("equality", "grasp2").solref = [0.1, 1.0]
    scene.root.find("equality", "grasp2").solimp = [0.9, 0.95, 0.001, 0.5, 2.0]
    with pytest.raises(
        TrialError,
        match=r"omnid2: weld error 1 is .* m at t = \d+\.\d\d s; the allowed range is 0 \.\. 1e-05 m",
    ):
        run_trial(scene, _short(scene))


def test_an_open_rod_fails_the_trial():
    scene = build_team("a")
    scene.root.find("equality", "omnid3/rod2").solref = [0.02, 1.0]
    scene.root.find("equality", "omnid3/rod2").solimp = [0.9, 0.95, 0.001, 0.5, 2.0]
    with pytest.raises(
        TrialError, match=r"omnid3: rod error 2 is .* m at t = .* the allowed range is 0 \.\. 2e-05 m"
    ):
        run_trial(scene, _short(scene))


@pytest.mark.parametrize(
    ("limit", "sentence"),
    [
        (
            {"torque_limit_Nm": 4.0},
            r"omnid\d: SEA torque \d is -?\d\.\d* N m at t = .* range is -4 \.\. 4 N m",
        ),
        ({"phi_max_rad": 0.7}, r"omnid\d: phi \d is 0\.7\d* rad at t = .* range is -0\.7854 \.\. 0\.7 rad"),
        ({"phi_min_rad": 0.6}, r"omnid\d: phi \d is 0\.\d* rad at t = .* range is 0\.6 \.\. 1\.571 rad"),
        ({"gimbal_limit_rad": 1e-3}, r"omnid\d: theta \(z, y, x\) \d is .* range is -0\.001 \.\. 0\.001 rad"),
    ],
)
def test_a_joint_out_of_its_range_fails_the_trial(team_a, monkeypatch, limit, sentence):
    _design(monkeypatch, **limit)
    with pytest.raises(TrialError, match=sentence):
        run_trial(team_a, _short(team_a))


@pytest.mark.parametrize("channel", ["qpos", "qvel", "ctrl"])
def test_nan_fails_the_trial(team_a, monkeypatch, tmp_path, channel):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file in the working directory
    tick = trial_module.TeamController.tick

    def spoil(self):
        tick(self)
        if self._tick == 700:
            getattr(spoiled["data"], channel)[5] = np.nan

    spoiled = {}
    make = mujoco.MjData
    monkeypatch.setattr(trial_module.mujoco, "MjData", lambda model: spoiled.setdefault("data", make(model)))
    monkeypatch.setattr(trial_module.TeamController, "tick", spoil)
    with pytest.raises(TrialError, match=r"MuJoCo warned mjWARN_BAD.* before t = 0\.99 s"):
        run_trial(team_a, _still(team_a))


def test_commands_outside_the_workspace_are_refused(team_a):
    ref = _still(team_a).ref_b
    ref[40, 1] += [0.0, 0.1, 0.1]
    with pytest.raises(
        InputError,
        match=r"omnid2: the command at t = 0\.40 s is 0\.141 m from home; the workspace ends at 0\.13 m",
    ):
        run_trial(team_a, Trajectory("random", ref))
    ref[40, 1] = np.nan
    with pytest.raises(InputError, match=r"omnid2: the command at t = 0\.40 s is nan m"):
        run_trial(team_a, Trajectory("random", ref))


@pytest.mark.parametrize(
    ("rate_hz", "timestep_s", "sentence"),
    [
        (150.0, 0.001, "control rate over recording rate is 1.5"),
        (50.0, 0.001, "control rate over recording rate is 0.5"),
        (2000.0, 0.001, "control period over time step is 0.5"),
        (1000.0, 0.002, "control period over time step is 0.5"),
        (1000.0, 0.0007, "control period over time step is 1.429"),
    ],
)
def test_time_that_does_not_divide_is_refused(rate_hz, timestep_s, sentence):
    """Rounded steps would run the physics at another speed than the clock."""
    scene = build_team("a", timestep_s=timestep_s)
    with pytest.raises(InputError, match=sentence):
        run_trial(scene, _still(scene), ControlGains(rate_hz=rate_hz))


@pytest.mark.parametrize(("rate_hz", "timestep_s"), [(500.0, 0.001), (1000.0, 0.0005), (1000.0, 0.00025)])
def test_simulated_time_is_the_logged_time(monkeypatch, rate_hz, timestep_s):
    scene = build_team("a", timestep_s=timestep_s)
    clock = []
    before_step = Rows.before_step

    def spy(self, sample):
        clock.append(self.data.time)
        before_step(self, sample)

    monkeypatch.setattr(Rows, "before_step", spy)
    log = run_trial(scene, _still(scene, 50), ControlGains(rate_hz=rate_hz))
    np.testing.assert_allclose(clock, log.time, rtol=0, atol=1e-9)


# The paper's trials


def _paper_trial(scene: TeamScene, kind: str, seed: int = 0) -> Trajectory:
    rng = np.random.default_rng(seed)
    if kind == "random":
        return random_vias(scene.wrist_home_b, rng, vias=12)
    if kind == "periodic":
        return sphere_motion(scene.wrist_home_b, scene.X_1i, 12.0, rng)
    return static_orientations(scene.wrist_home_b, scene.X_1i, hold_s=1.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_uncalibrated_units_run_too(seed):
    units = CalibrationSpread(np.deg2rad(1.0), 0.02, 1e-3, 0.02).draw(3, np.random.default_rng(seed))
    scene = build_team("b", units)
    log = run_trial(scene, _paper_trial(scene, "random", seed))
    assert log.rod_error_m < 0.5 * 0.02e-3
    assert log.weld_error_m < 0.6 * 0.01e-3
    drift = np.linalg.norm(_wrists_from_phi(log.phi[0]) - _wrists_from_phi(log.phi[-1]), axis=-1)
    assert drift.max() > 0.5e-3, "their controllers believe in another home"


INSIDE = slice(200, -200)


def _rms(one, two) -> dict[str, float]:
    return {
        name: float(np.sqrt(np.mean((getattr(one, name)[INSIDE] - getattr(two, name)[INSIDE]) ** 2)))
        for name in ("phi", "theta", "tau")
    }


@pytest.fixture(scope="module")
def recording(random_a):
    return measure(random_a, sensor_preset("ideal"), np.random.default_rng(0), payload="a")


def test_the_same_team_does_the_same_again(recording, tmp_path):
    """Through a file, too. Only the first second knows that the load was taken up."""
    path = tmp_path / "rec.parquet"
    write_recording(recording, path)
    again = predicted(resimulate(read_recording(path), build_team("a")))
    difference = _rms(again, recording)
    assert difference["phi"] < 1e-7
    assert difference["theta"] < 1e-7
    assert difference["tau"] < 1e-6
    assert np.abs(again.phi[0] - recording.phi[0]).max() < 1e-6


def test_the_guilty_effect_explains_a_recording_and_others_do_not(recording):
    hidden = predicted(resimulate(recording, team_with("a", example("sea_scale", 2))))
    assert _rms(hidden, recording)["tau"] > 1e-2
    right = predicted(resimulate(hidden, team_with("a", example("sea_scale", 2))))
    wrong = predicted(resimulate(hidden, team_with("a", example("sea_scale", 3))))
    hidden_scale = _rms(right, hidden)
    assert hidden_scale["tau"] < 2e-5
    assert _rms(wrong, hidden)["tau"] > 1e-2


def _from_numbers(truth: GroundTruth, team) -> tuple:
    """The same payload from its numbers, and the bases from poses in another world."""
    inertia = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    X_1i = RigidTransform.from_components(truth.p_1i, Rotation.from_matrix(truth.R_1i))
    turn = RigidTransform.from_components([1.0, -2.0, 0.0], Rotation.from_euler("z", 0.7))
    return payload_mjcf(truth.mass_kg, truth.p_1c, inertia, X_1i), turn * team.mounts


def test_a_team_from_numbers_alone_is_the_team(recording, team_a):
    payload, mounts = _from_numbers(GroundTruth.of(team_a), team_a)
    scene = build_team(payload, mounts=mounts)
    truth, other = GroundTruth.of(team_a), GroundTruth.of(scene)
    for entry in ("R_1i", "p_1i", "p_1c", "principal_kgm2"):
        np.testing.assert_allclose(getattr(other, entry), getattr(truth, entry), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(scene.wrist_home_b, team_a.wrist_home_b, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scene.theta_home, team_a.theta_home, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scene.X_Wb.translation[:, 2], base_height_m(), rtol=0, atol=1e-15)
    difference = _rms(predicted(resimulate(recording, scene)), recording)
    assert difference["phi"] < 1e-6
    assert difference["tau"] < 1e-5


def test_mounts_that_are_off_are_assembled_from_the_first_sample(recording, team_a):
    """Estimated base poses, half a millimetre and a milliradian off in every coordinate."""
    payload, mounts = _from_numbers(GroundTruth.of(team_a), team_a)
    rng = np.random.default_rng(0)
    error = RigidTransform.from_components(
        rng.normal(0, 5e-4, (3, 3)), Rotation.from_rotvec(rng.normal(0, 1e-3, (3, 3)))
    )
    again = predicted(resimulate(recording, build_team(payload, mounts=mounts * error)))
    assert 1e-5 < np.abs(again.phi[0] - recording.phi[0]).max() < 0.02
    assert _rms(again, recording)["phi"] < 0.02


def test_what_cannot_be_resimulated_is_refused(recording, teams):
    scene = build_team("a")
    meta = recording.metadata

    def but(**changes):
        return dataclasses.replace(recording, metadata=dataclasses.replace(meta, **changes), name="rec")

    cases = [
        (dataclasses.replace(recording, ref=None, name="rec"), scene, "rec: has no commands"),
        (but(control=None), scene, "rec: metadata has no 'control'"),
        (but(control={}), scene, r"rec: control.feed_forward_N is null; it must be 3 x 3 finite numbers"),
        (but(control=meta.control | {"feed_forward_N": [[1, 2]]}), scene, r"feed_forward_N is \[\[1, 2\]\]"),
        (but(control=meta.control | {"torque_gain": -1}), scene, "rec: control.torque_gain is -1"),
        (but(rate_hz=200.0), scene, "rec: rate_hz is 200; resimulating it needs 100"),
        (
            recording,
            build_team("a", timestep_s=0.001) and teams[2],
            "was recorded with 3 robots; the scene has 2",
        ),
    ]
    for bad, team, sentence in cases:
        with pytest.raises(InputError, match=sentence):
            resimulate(bad, team)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"mass_kg": 0.0}, "payload mass is 0 kg"),
        ({"p_1c": [np.nan, 0, 0]}, "payload centre of mass"),
        ({"inertia_1": np.diag([1.0, 1.0, 2.5])}, r"principal moments \(1, 1, 2.5\)"),
        ({"inertia_1": np.diag([-1.0, 1.0, 1.0])}, "greater than 0"),
        ({"inertia_1": np.diag([1.0, 1.0, 1.0]) + np.eye(3, k=1)}, "not symmetric"),
    ],
)
def test_payloads_that_no_body_has_are_refused(changes, sentence):
    numbers = {"mass_kg": 1.0, "p_1c": np.zeros(3), "inertia_1": np.eye(3)} | changes
    with pytest.raises(InputError, match=sentence):
        payload_mjcf(**numbers, X_1i=RigidTransform.identity(2))
