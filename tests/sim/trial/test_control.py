"""The wrist controller against MuJoCo's state and statics on paper, and whether it is stable."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from closed_loop import ClosedLoop
from command import run
from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains, home_phi
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.kernels import wrist
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene, build_free_team, build_team
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.trial import run_trial
from payload_mjcf import ONE, Grasp, Payload

REACH, PROXIMAL, ROD = 0.18 - 0.062, 0.200, 0.368
FEATHER = Payload((Grasp(),), mass_kg=1e-3, com_m=(0.0, 0.0, -0.01), inertia_kgm2=(1e-6, 1e-6, 1e-6))


@pytest.fixture(scope="module")
def feather(tmp_path_factory) -> TeamScene:
    """One robot that carries next to nothing."""
    return build_team(FEATHER.write(tmp_path_factory.mktemp("feather")))


@pytest.fixture
def one(teams) -> TeamScene:
    return teams[1]


def _jacobian(phi) -> np.ndarray:
    _, s, lever, _ = wrist(np.asarray(phi), REACH, PROXIMAL, ROD)
    return np.linalg.solve(np.array(s), np.diag(lever))


def test_kinematics_agree_with_the_simulated_mechanism_in_motion(teams):
    """Five robots, thrown about: wrist from phi against the platform's slides, its rate against their speeds."""
    loop = ClosedLoop(teams[5])
    rng = np.random.default_rng(8)
    seen_h, seen_v = [], []
    for _ in range(12):
        loop.run(0.15, teams[5].wrist_home_b + rng.uniform(-0.06, 0.06, (5, 3)))
        phi_dot = loop.data.qvel[loop.index.motor_dof] + loop.data.qvel[loop.index.spring_dof]
        for i, phi in enumerate(loop.phi()):
            h, s, lever, cos_phi = wrist(phi, REACH, PROXIMAL, ROD)
            np.testing.assert_allclose(h, loop.wrist()[i], rtol=0, atol=0.01e-3)
            h_dot = np.linalg.solve(np.array(s), lever * phi_dot[i])
            # The steps of the command shake the loops: the constraints' rates close to 0.1 %.
            np.testing.assert_allclose(h_dot, loop.data.qvel[loop.index.slide_dof[i]], rtol=0, atol=1e-3)
            np.testing.assert_array_equal(cos_phi, np.cos(phi))
            np.testing.assert_allclose(np.linalg.norm(s, axis=1), ROD, rtol=1e-14)
            seen_h.append(h)
            seen_v.append(h_dot)
    assert len(seen_h) == 60
    assert np.ptp(np.array(seen_h), axis=0).min() > 0.03
    assert np.abs(seen_v).max() > 0.1


def test_kinematics_invert_the_closed_form_over_the_whole_workspace():
    """The inverse is a triangle in each leg's plane."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(500, 3))
    points *= (0.13 * rng.uniform(0, 1, (500, 1)) ** (1 / 3)) / np.linalg.norm(points, axis=1, keepdims=True)
    for point in points + np.array([0, 0, 0.355]):
        phi = np.empty(3)
        for k in range(3):
            c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
            # In the leg's plane: x outward from the driven axis to the wrist, y sideways, z up.
            x, y, z = c * point[0] + s * point[1] - REACH, -s * point[0] + c * point[1], point[2]
            # |(x - L cos phi, y, z - L sin phi)| = rod, the knee outside.
            need = (x * x + y * y + z * z + PROXIMAL**2 - ROD**2) / (2 * PROXIMAL)
            phi[k] = np.arctan2(z, x) - np.arccos(need / np.hypot(x, z))
        np.testing.assert_allclose(wrist(phi, REACH, PROXIMAL, ROD)[0], point, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["a", "b", "c"])
def test_feed_forward_takes_up_the_static_load(name):
    """Grasps at one height: three moment balances give the vertical loads, whatever the internal forces."""
    mass, com, grasps = {
        "a": (11.672, (0.537, 0.156), ((0, 0), (0.647, 0.533), (1.105, -0.305))),
        "b": (11.672, (0.034, 0.535), ((0, 0), (-0.686, 0.572), (0.419323, 0.761554))),
        "c": (10.478, (0.547, -0.670), ((0, 0), (-0.115, -1.143), (0.685894, -0.914996))),
    }[name]
    loop = ClosedLoop(build_team(name))
    loop.run(1.5, loop.scene.wrist_home_b)
    moments = np.vstack([np.ones(3), np.array(grasps).T])
    vertical = np.linalg.solve(moments, mass * 9.81 * np.array([1.0, *com]))
    np.testing.assert_allclose(loop.controller.feed_forward[:, 2], vertical, rtol=0, atol=0.05)
    np.testing.assert_allclose(loop.controller.feed_forward[:, 2].sum(), mass * 9.81, rtol=1e-5)
    # The same as MuJoCo's own forces between robots and payload, in each robot's base frame.
    force_W = loop.forces_on_payload()
    for i in range(3):
        R_Wb = loop.data.body(f"omnid{i + 1}/base").xmat.reshape(3, 3)
        np.testing.assert_allclose(loop.controller.feed_forward[i], R_Wb.T @ force_W[i], rtol=0, atol=0.01)


def test_gravity_compensation_floats_the_bare_arm_anywhere(feather):
    """With no load the wrist reaches every command: 1 % of the arm's 8.3 N would show as 0.2 mm."""
    loop = ClosedLoop(feather)
    loop.run(1.2, feather.wrist_home_b)
    weight = np.array([[0, 0, 9.81e-3]])
    np.testing.assert_allclose(loop.controller.feed_forward, weight, rtol=0, atol=2e-3)
    for offset in ([0.08, 0, 0], [-0.05, 0.08, 0], [0, -0.05, 0.08], [0.03, 0.03, -0.10], [0, 0, 0.12]):
        loop.run(2.0, feather.wrist_home_b + offset)
        np.testing.assert_allclose(loop.wrist(), feather.wrist_home_b + offset, rtol=0, atol=0.01e-3)


@pytest.mark.parametrize("stiffness", [400.0, 900.0])
def test_a_push_displaces_the_wrist_like_a_spring(feather, stiffness):
    """At rest K (ref - h) + F_ff balances the load and the push: h - ref = push / K on every axis."""
    gains = ControlGains(stiffness_N_per_m=stiffness)
    loop = ClosedLoop(feather, gains)
    ref = feather.wrist_home_b + np.array([0.02, -0.03, 0.01])
    loop.run(1.2, feather.wrist_home_b)
    loop.run(1.0, ref)
    push = np.array([8.0, -5.0, 12.0])
    loop.data.xfrc_applied[loop.model.body("omnid1/platform").id, :3] = push
    loop.run(2.5, ref)
    # 0.01 N: no steady error in the torque loop either.
    np.testing.assert_allclose(loop.wrist() - ref, [push / stiffness], rtol=0, atol=0.01 / stiffness)


def test_damping_resists_the_rate_of_the_command_error(feather):
    """A wrist at rest that is told to move feels D times the commanded rate: read off the motor torques."""
    home, rate = feather.wrist_home_b, np.array([[0.3, -0.2, 0.1]])
    torques = []
    for ref_dot in (np.zeros((1, 3)), rate):
        loop = ClosedLoop(feather)
        loop.controller.update(home, ref_dot)
        torques.append(loop.data.ctrl[loop.index.actuator[0]].copy())
    gains = ControlGains()
    wanted = (1 + gains.torque_gain) * _jacobian(np.full(3, home_phi(omnid_design()))).T @ (50.0 * rate[0])
    np.testing.assert_allclose(torques[1] - torques[0], wanted, rtol=1e-9)


def test_motor_torque_saturates(feather):
    loop = ClosedLoop(feather, ControlGains(motor_torque_limit_Nm=1.5))
    loop.controller.update(feather.wrist_home_b + np.array([0, 0, 0.1]), np.zeros((1, 3)))
    np.testing.assert_array_equal(loop.data.ctrl[loop.index.actuator[0]], 1.5)


def test_encoder_zeros_displace_the_true_wrist_not_the_believed_one(one):
    zero = np.array([0.02, -0.01, 0.015])
    loop = ClosedLoop(one, as_built=[AsBuilt(phi_zero_rad=zero)])
    ref = one.wrist_home_b
    loop.run(5.0, ref)
    believed = wrist(loop.phi()[0] + zero, REACH, PROXIMAL, ROD)[0]
    np.testing.assert_allclose(believed, ref[0], rtol=0, atol=0.5e-3)
    shift = -_jacobian(loop.phi()[0] + zero) @ zero
    assert np.linalg.norm(shift) > 2e-3
    np.testing.assert_allclose(loop.wrist()[0] - believed, shift, rtol=0.03, atol=0.05e-3)


def test_torque_zeros_are_taken_up_as_load(one):
    zero = np.array([0.3, -0.1, 0.2])
    forces = []
    for units in ([], [AsBuilt(tau_zero_Nm=zero)]):
        loop = ClosedLoop(one, as_built=units)
        loop.controller.update(one.wrist_home_b, np.zeros((1, 3)))
        forces.append(loop.controller.feed_forward[0])
    np.testing.assert_allclose(forces[0], [0, 0, 9.81 * ONE.mass_kg], rtol=0, atol=1e-9)
    J = _jacobian(np.full(3, home_phi(omnid_design())))
    np.testing.assert_allclose(forces[1] - forces[0], np.linalg.solve(J.T, zero), rtol=1e-9)


@pytest.mark.parametrize("bad", [-1.0, float("nan"), float("inf"), True, "400", None, 10**400])
def test_bad_gain_is_named(bad):
    values = ControlGains().to_dict() | {"damping_Ns_per_m": bad}
    with pytest.raises(
        InputError, match=r"control\.damping_Ns_per_m is .*; it must be a number from 0 to 100000$"
    ):
        ControlGains.from_dict(values)
    with pytest.raises(InputError, match=r"control\.rate_hz is None"):
        ControlGains.from_dict({k: v for k, v in values.items() if k != "rate_hz"})


def held(scene: TeamScene, samples: int = 2) -> Trajectory:
    home = np.broadcast_to(scene.wrist_home_b, (scene.robots, 3))
    return Trajectory("random", np.repeat(home[None], samples, axis=0))


@pytest.mark.parametrize(("damping", "stable", "warns"), [(50.0, True, False), (5.0, False, True)])
def test_soft_impedance_without_damping_is_unstable(
    team_a: TeamScene, damping: float, stable: bool, warns: bool
) -> None:
    found = run_trial(team_a, held(team_a), ControlGains(damping_Ns_per_m=damping)).stability
    assert found is not None
    assert found.stable is stable
    assert found.stable is (found.growth_per_s < 0)
    assert (found.warning is not None) is warns
    assert 0.5 < found.frequency_Hz < 1.5  # a payload of some 12 kg on three springs of 400 N/m


def test_what_is_hardly_damped_is_warned_of(team_a: TeamScene) -> None:
    found = run_trial(team_a, held(team_a), ControlGains(damping_Ns_per_m=6.5)).stability
    assert found is not None
    assert found.stable
    assert 0 < found.damping_ratio < 0.02
    assert "hardly damped" in str(found.warning)


@pytest.mark.parametrize(("lag_s", "stable"), [(0.005, True), (0.0055, False)])
def test_torques_grow_in_the_trial_as_predicted(
    teams: dict[int, TeamScene], lag_s: float, stable: bool
) -> None:
    """A torque sensor that lags; a tap of micrometres, and what is left of it after one mode is alone."""
    scene = apply_effects(teams[1], [make_effect("torque_lag", {"time_constant_s": lag_s}, 1)])
    motion = held(scene, 280)
    motion.ref_b[5:15] += [1e-6, 2e-6, 0.0]
    log = run_trial(scene, motion)
    assert log.stability is not None
    assert log.stability.stable is stable
    change = np.diff(log.sensed.tau.reshape(2800, 3), axis=0)
    early, late = (np.sqrt(np.mean(change[at : at + 200] ** 2)) for at in (1400, 2400))
    assert np.log(late / early) / 1.0 == pytest.approx(log.stability.growth_per_s, rel=0.05)
    spectrum = np.abs(np.fft.rfft(change[1400:2400, 0]))
    assert np.argmax(spectrum) == pytest.approx(log.stability.frequency_Hz, abs=1.0)  # 1 s: a bin is 1 Hz


def test_robots_that_hold_nothing_are_stable() -> None:
    """Their gimbals stay where they are left, which is no mode that grows."""
    scene = build_free_team(2, (), np.full((2, 3), 0.2))
    found = run_trial(scene, held(scene)).stability
    assert found is not None
    assert found.stable
    assert found.warning is None


def test_the_command_warns_of_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "rec.parquet"
    lag = "torque_lag:robot=2,time_constant=0.006"
    code, text, _ = run(capsys, "simulate", "--payload", "b", "--vias", "1", "--effect", lag, "--out", out)
    assert code == 0
    assert text.splitlines()[0].startswith(f"{out}: ")
    assert text.splitlines()[1].startswith("The control is unstable: a swing of 26 Hz grows")


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("stiffness_N_per_m", -1.0, "0 to 1e+06"),
        ("damping_Ns_per_m", 1e9, "0 to 100000"),
        ("torque_gain", float("nan"), "0 to 1000"),
        ("take_up_time_constant_s", 0.0, "1e-06 to 3600"),
        ("motor_torque_limit_Nm", True, "0.001 to 100000"),
    ],
)
def test_a_gain_out_of_its_range_is_refused(name: str, bad: float, allowed: str) -> None:
    with pytest.raises(InputError) as refusal:
        replace(ControlGains(), **{name: bad})
    assert str(refusal.value) == f"control.{name} is {bad!r}; it must be a number from {allowed}"
