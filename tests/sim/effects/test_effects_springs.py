"""Friction, springs, sensors' zeros and timing, against Coulomb's law, closed forms and densely sampled truth."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from closed_loop import ClosedLoop
from effect_cases import example, one_robot, team_with
from mocobot_sim.control.control import lag_filter
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.soft import damper_parameters
from mocobot_sim.trial.resimulate import predicted
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

FRICTION = (
    int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF),
    int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON),
)
EQUALITY = (int(mujoco.mjtConstraint.mjCNSTR_EQUALITY),)


def _row(loop: ClosedLoop, kinds: tuple[int, ...], of: int) -> int:
    data = loop.data
    rows = [k for k in range(data.nefc) if int(data.efc_type[k]) in kinds and data.efc_id[k] == of]
    assert len(rows) == 1
    return rows[0]


def _move(
    loop: ClosedLoop, seconds: float, row_of, amplitude_m: float = 0.03
) -> tuple[np.ndarray, np.ndarray]:
    """Constraint force and velocity of a row in every step of a motion in all directions."""
    home, force, velocity = loop.scene.wrist_home_b, [], []
    omega = 2 * np.pi * np.array([0.7, 0.9, 0.6])
    for tick in range(round(1000 * seconds)):
        t = tick / 1000
        ref = home + amplitude_m * np.sin(omega * t)
        loop.controller.update(ref, np.tile(amplitude_m * omega * np.cos(omega * t), (len(home), 1)))
        mujoco.mj_step(loop.model, loop.data)
        row = row_of()
        force.append(loop.data.efc_force[row])
        velocity.append(loop.data.efc_vel[row])
    return np.array(force), np.array(velocity)


@pytest.mark.parametrize(("cause", "limit"), [("joint_friction", 0.05), ("sea_hysteresis", 0.05)])
def test_coulomb_friction_of_leg_2_opposes_the_motion_at_its_limit(tmp_path, cause, limit):
    changes = {"viscous_Nms_per_rad": 0.0} if cause == "joint_friction" else {}
    loop = ClosedLoop(one_robot(tmp_path, example(cause, **changes)))
    model = loop.model
    of = 0 if cause == "joint_friction" else int(model.joint("omnid1/spring2").dofadr[0])
    force, velocity = _move(loop, 4.0, lambda: _row(loop, FRICTION, of))
    assert np.abs(force).max() <= limit * (1 + 1e-9)
    # Fast enough that it does not stop within a step.
    sliding = np.abs(velocity) > (0.05 if cause == "joint_friction" else 0.005)
    assert sliding.mean() > 0.3
    np.testing.assert_allclose(force[sliding], -limit * np.sign(velocity[sliding]), rtol=1e-6)


def test_a_slider_behind_a_spring(tmp_path):
    """By hand: 0.2 N m of friction that gives way over 0.1 N m, which is 1 mrad of a spring of 100 N m/rad."""
    effect = example("sea_hysteresis", friction_Nm=0.2, presliding_Nm=0.1)
    loop = ClosedLoop(one_robot(tmp_path, effect))
    assert not loop.model.dof_frictionloss.any()
    (slider,) = effect.actors(None)
    angles = iter([0.0, 0.5e-3, 4e-3, 3.5e-3, 2e-3, 2e-3])
    qpos, dof = int(loop.index.spring_qpos[0, 1]), int(loop.index.spring_dof[0, 1])
    loop.data.qpos[qpos] = next(angles)
    slider.start(SimpleNamespace(data=loop.data, index=loop.index))
    torques = []
    for angle in angles:
        loop.data.qpos[qpos], loop.data.qfrc_applied[:] = angle, 0.0
        slider.act(0)
        torques.append(loop.data.qfrc_applied[dof])
        assert np.count_nonzero(loop.data.qfrc_applied) <= 1
    np.testing.assert_allclose(torques, [-0.1, -0.2, -0.1, 0.2, 0.2], atol=1e-12)
    assert example("sea_hysteresis").actors(None) == ()


def test_joint_friction_acts_on_phi_and_not_on_the_reading(tmp_path):
    """Its row is the rate of motor plus spring: the link against the chassis."""
    loop = ClosedLoop(one_robot(tmp_path, example("joint_friction")))
    _move(loop, 0.5, lambda: _row(loop, FRICTION, 0))
    row = _row(loop, FRICTION, 0)
    rates = loop.data.qvel[[loop.index.motor_dof[0, 1], loop.index.spring_dof[0, 1]]]
    mujoco.mj_forward(loop.model, loop.data)
    assert loop.data.efc_vel[row] == pytest.approx(rates.sum(), rel=1e-12)
    assert loop.data.ten_length[0] == pytest.approx(loop.phi()[0, 1] - 0.6230299772752583, abs=1e-9)


@pytest.mark.parametrize(
    ("cause", "joint"), [("joint_friction", 2), ("gimbal_friction", 2), ("gimbal_friction", 3)]
)
@pytest.mark.parametrize("viscous", [1e-4, 0.02, 0.2])
def test_viscous_friction_is_proportional_to_the_rate(tmp_path, cause, joint, viscous):
    """Constraint force over rate, in motion; the row's own inertia may add 3 % of it, or 2e-4 of the joint's."""
    effect = example(cause, joint=joint, coulomb_Nm=0.0, viscous_Nms_per_rad=viscous)
    loop = ClosedLoop(one_robot(tmp_path, effect))
    name = "friction1_2" if cause == "joint_friction" else f"damping1_gimbal_{'zyx'[joint - 1]}"
    equality = loop.model.equality(name).id
    force, rate = _move(loop, 3.0, lambda: _row(loop, EQUALITY, equality))
    assert np.abs(rate).max() > 0.05
    error = force + viscous * rate
    on = loop.model.eq_obj1id[equality]
    tendon = cause == "joint_friction"
    inverse = (
        loop.model.tendon_invweight0[on] if tendon else loop.model.dof_invweight0[loop.model.jnt_dofadr[on]]
    )
    own = 2e-4 / inverse * np.sqrt(np.mean(np.gradient(rate, 1e-3) ** 2))
    assert np.sqrt(np.mean(error**2)) < 0.03 * viscous * np.sqrt(np.mean(rate**2)) + own


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 1.0, 50.0])
@pytest.mark.parametrize("inertia", [1e-4, 0.1, 10.0])
def test_damper_slows_a_flywheel_exponentially(damping, inertia):
    solref, solimp = damper_parameters(damping, 1.0 / inertia)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody><body>
        <joint name="j" type="hinge"/><inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
        </body></worldbody><equality><joint joint1="j" solref="{solref[0]} {solref[1]}"
        solimp="{" ".join(map(repr, solimp))}"/></equality></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    steps = 1000
    mujoco.mj_step(model, data, nstep=steps)
    time_constant = inertia / damping
    expected = np.exp(-1.0 / time_constant)
    # A damper faster than a step stops the wheel; otherwise the row's inertia and the step's length count.
    slack = 0.5 * damping * 1e-3 / inertia + damping / 1000 / inertia + 1e-3
    assert -1e-3 < data.qvel[0] < 1.0
    assert (
        abs(np.log(max(data.qvel[0], 1e-9)) + 1.0 / time_constant) < slack / time_constant + 1e-4
        or expected < 1e-3
    )


def _turn(tmp_path, torque: float, coulomb: float, seconds: float) -> tuple[np.ndarray, float]:
    """Angles of the hanging payload's yaw joint under a constant torque, and its inertia about that axis."""
    scene = one_robot(
        tmp_path, example("gimbal_friction", joint=1, coulomb_Nm=coulomb, viscous_Nms_per_rad=0.0)
    )
    loop = ClosedLoop(scene)
    dof = int(loop.model.joint("omnid1/gimbal_z").dofadr[0])
    full = np.zeros((loop.model.nv, loop.model.nv))
    mujoco.mj_fullM(loop.model, loop.data, full)
    loop.data.qfrc_applied[dof] = torque
    angles = []
    for _ in range(round(1000 * seconds)):
        loop.controller.update(scene.wrist_home_b, np.zeros((1, 3)))
        mujoco.mj_step(loop.model, loop.data)
        angles.append(loop.data.joint("omnid1/gimbal_z").qpos[0])
    return np.array(angles), float(full[dof, dof])


@pytest.mark.parametrize("coulomb", [5e-3, 0.1])
def test_stiction_holds_below_the_limit(tmp_path, coulomb):
    """Creep at 90 % of the limit is under 1e-6 rad per second."""
    angles, _ = _turn(tmp_path, 0.9 * coulomb, coulomb, 2.0)
    assert np.abs(angles).max() < 1e-5
    assert abs(angles[-1] - angles[-1001]) < 1e-6


DESIGN_K = 100.0


def _run(*effects, vias: int = 2):
    scene = team_with("a", *effects)
    return run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(1), vias))


@pytest.fixture(scope="module")
def clean():
    return _run()


@pytest.mark.parametrize("channel", ["phi", "theta", "tau"])
@pytest.mark.parametrize("robot", [1, 3])
def test_zeros_shift_one_reading(channel, robot):
    cause, size = {"phi": ("phi_zero", 1e-3), "theta": ("theta_zero", 1e-3), "tau": ("sea_bias", 0.05)}[
        channel
    ]
    log = _run(example(cause, robot, joint=3), vias=1)
    recording = predicted(log)
    for name in ("phi", "theta", "tau"):
        shift = getattr(recording, name) - getattr(log, name)
        expected = np.zeros((3, 3))
        if name == channel:
            expected[robot - 1, 2] = size
        np.testing.assert_allclose(shift, np.tile(expected, (len(shift), 1, 1)), rtol=0, atol=1e-13)


@pytest.mark.parametrize("cubic", [-100.0, 300.0, 3000.0])
def test_hardening_is_read_as_a_linear_spring(cubic):
    """True torque k d + k3 d^3 and reading k d of the same deflection."""
    log = _run(example("sea_hardening", 2, joint=1, cubic_Nm_per_rad3=cubic))
    reading = predicted(log).tau[:, 1, 0]
    deflection = -reading / DESIGN_K
    np.testing.assert_allclose(log.tau[:, 1, 0], -(DESIGN_K * deflection + cubic * deflection**3), rtol=1e-10)
    assert np.abs(log.tau[:, 1, 0] - reading).max() > 1e-5 * abs(cubic)
    np.testing.assert_allclose(predicted(log).tau[:, 0], log.tau[:, 0], rtol=0, atol=1e-12)


def test_hysteresis_makes_the_reading_lag_the_link(clean):
    """Reading and true spring agree: the deflection's. What differs from a clean trial is the friction's share."""
    log = _run(example("sea_hysteresis", 2, friction_Nm=0.1))
    np.testing.assert_allclose(predicted(log).tau, log.tau, rtol=0, atol=1e-12)
    difference = log.tau[200:-200, 1, 1] - clean.tau[200:-200, 1, 1]
    assert 0.02 < np.abs(difference).max() < 0.3


def test_link_lengths_are_in_the_model_and_the_record():
    effect = example("link_length", 3, joint=2, proximal_m=1e-3, rod_m=-2e-3, base_radius_m=3e-3)
    scene, clean = team_with("a", effect), build_team("a")
    model, design = scene.compile(), clean.compile()

    def changed(part):
        return getattr(model, part[0])(part[1]).pos - getattr(design, part[0])(part[1]).pos

    np.testing.assert_allclose(changed(("body", "omnid3/rod2")), [1e-3, 0, 0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(changed(("site", "omnid3/rod2_tip")), [-2e-3, 0, 0], rtol=0, atol=1e-15)
    outward = np.array([-0.5, np.sqrt(0.75), 0])
    np.testing.assert_allclose(changed(("body", "omnid3/proximal2")), 3e-3 * outward, rtol=0, atol=1e-15)
    same = model.body_pos != design.body_pos
    assert same.any(axis=1).sum() == 2
    unit = scene.units[2]
    np.testing.assert_array_equal(unit.rod_length_m, [0, -2e-3, 0])
    np.testing.assert_array_equal(unit.proximal_length_m, [0, 1e-3, 0])
    np.testing.assert_array_equal(unit.base_radius_m, [0, 3e-3, 0])


@pytest.mark.parametrize("delay_ticks", [-7, 3, 12])
def test_late_torques_are_earlier_rows_of_the_dense_log(clean, delay_ticks):
    log = _run(example("torque_skew", 2, delay_s=delay_ticks * 1e-3))
    recording = predicted(log)
    np.testing.assert_array_equal(log.sensed.tau, clean.sensed.tau)
    rows = 10 * np.arange(5, len(log.time) - 5)
    np.testing.assert_allclose(
        recording.tau[5:-5, 1], clean.sensed.tau[rows - delay_ticks, 1], rtol=0, atol=1e-9
    )
    for other in (0, 2):
        np.testing.assert_array_equal(recording.tau[:, other], clean.tau[:, other])
    np.testing.assert_array_equal(recording.phi, clean.phi)
    np.testing.assert_array_equal(recording.theta, clean.theta)


def test_a_late_clock_shifts_everything_but_the_commands(clean):
    log = _run(example("clock_delay", 2, delay_s=0.004), example("torque_skew", 2, delay_s=0.003))
    recording = predicted(log)
    rows = 10 * np.arange(5, len(log.time) - 5)
    for channel, ticks in (("phi", 4), ("theta", 4), ("tau", 7)):
        expected = getattr(clean.sensed, channel)[rows - ticks, 1]
        np.testing.assert_allclose(getattr(recording, channel)[5:-5, 1], expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(getattr(recording, channel)[:, 0], getattr(log, channel)[:, 0])
    np.testing.assert_array_equal(recording.ref, clean.ref_b)
    np.testing.assert_array_equal(log.phi, clean.phi)


@pytest.mark.parametrize("time_constant_s", [1e-4, 1e-3, 0.02])
def test_lag_of_a_ramp_and_of_a_sine_is_the_filters(time_constant_s):
    a, old, new = lag_filter(time_constant_s, 1e-3)
    time = np.arange(2000) / 1000.0
    for signal, steady in (
        (time, time - time_constant_s),
        (np.sin(20 * time), np.imag(np.exp(20j * time) / (1 + 20j * time_constant_s))),
    ):
        y = np.zeros(2000)
        y[0] = signal[0]
        for k in range(1, 2000):
            y[k] = a * y[k - 1] + old * signal[k - 1] + new * signal[k]
        np.testing.assert_allclose(y[1000:], steady[1000:], rtol=0, atol=5e-5)


def test_a_lagging_torque_sensor_is_seen_by_log_and_controller(clean):
    """y + T dy/dt = x: the reading against the true spring torque, and a motion that is no longer the same."""
    T = 0.004
    log = _run(example("torque_lag", 2, time_constant_s=T))
    y = log.sensed.tau[:, 1]
    x = y + T * np.gradient(y, 1e-3, axis=0)
    np.testing.assert_allclose(x[20:-20:10], log.tau[2:-2, 1][: len(x[20:-20:10])], rtol=0, atol=5e-3)
    assert np.abs(log.tau[:, 1] - y[::10]).max() > 0.02
    np.testing.assert_allclose(log.sensed.tau[::10, 0], log.tau[:, 0], rtol=0, atol=1e-12)
    assert np.abs(log.phi - clean.phi).max() > 1e-5
