"""Errors of readings: columns of causes against the full residual of signals spoiled by independent means."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.signal import lfilter

from discrepancy.candidate import Transient
from discrepancy.team.candidates import in_shapes
from discrepancy.team.causes import CAUSES, default_tolerances
from discrepancy.team.causes.base import Context
from discrepancy.team.causes.readings import Late
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import Sensed
from discrepancy.team.linear.trial_linear import filtered, linearise
from discrepancy.team.rig import TeamRig
from estimator.arm.delta import LEG_DIRECTIONS, forward_kinematics, jacobian
from estimator.estimate.grasps import GraspEstimate
from estimator.rigid_team import Bases, Shared
from mocobot_sim.effects.catalogue import EFFECTS
from patchwork import dense
from team_case import DESIGN, assert_close, exact, rate_of, residual_of

ROBOTS = (0, 2)
RATE = 100.0


@pytest.fixture(scope="module")
def case():
    return exact()


def put(array, robot, new):
    out = array.copy()
    out[:, robot] = new
    return out


def with_joint(array, joint, new):
    out = array.copy()
    out[:, joint] = new
    return out


def resampled(x, delay):
    """x(t - delay) by a spline of the seventh degree, held at the ends."""
    time = np.arange(len(x)) / RATE
    return make_interp_spline(time, x, k=7)(np.clip(time - delay, 0.0, time[-1]))


def lagged(x, constant):
    """T y' + y = x, integrated at 10 kHz, at rest before."""
    time = np.arange(len(x)) / RATE
    fine = np.arange((len(x) - 1) * 100 + 1) / (100 * RATE)
    decay = np.exp(-1.0 / (100 * RATE) / constant)
    u = make_interp_spline(time, x, k=5)(fine)
    # Over one step the input is taken as its mean.
    mean = np.concatenate([u[:1], 0.5 * (u[1:] + u[:-1])])
    y = lfilter([1.0 - decay], [1.0, -decay], mean, axis=0, zi=decay * u[:1])[0]
    return y[::100]


def hardened(tau, cubic):
    k = DESIGN.sea_stiffness_Nm_per_rad
    return np.array([k * brentq(lambda d, t=t: k * d + cubic * d**3 - t, -3.0, 3.0) for t in tau])


def leg_angles(h, joint, proximal, rod, radius):
    """Angle at which one leg of these lengths reaches wrists h, knee outward; the design's legs elsewhere."""
    reach = h - (DESIGN.base_radius_m - DESIGN.platform_radius_m + radius) * LEG_DIRECTIONS[joint]
    along, up = reach @ LEG_DIRECTIONS[joint], reach[:, 2]
    l1, l2 = DESIGN.proximal_length_m + proximal, DESIGN.rod_length_m + rod
    # The law of cosines in the triangle of axis, knee and wrist.
    cosine = (l1**2 + np.sum(reach**2, axis=1) - l2**2) / (2 * l1 * np.hypot(along, up))
    return np.arctan2(up, along) - np.arccos(cosine)


def other_leg(case, robot, joint, lengths):
    """Angles and torques of a robot with one leg of other lengths that does the same to the payload."""
    phi, tau = case.signals.phi[:, robot], case.signals.tau[:, robot]
    h = forward_kinematics(phi, DESIGN)
    step = 1e-5

    def angles(h):
        true = np.array([leg_angles(h, j, 0.0, 0.0, 0.0) for j in range(3)]).T
        true[:, joint] = leg_angles(h, joint, *lengths)
        return true

    # dphi/dh of the true robot, by differences; its inverse transposed takes torques to forces.
    inverse = np.stack(
        [(angles(h + step * e) - angles(h - step * e)) / (2 * step) for e in np.eye(3)], axis=2
    )
    # What hangs at the knees stays with the legs, all else goes through the wrist.
    at_knee = (
        DESIGN.proximal_mass_kg * DESIGN.proximal_com_m + 0.5 * DESIGN.rod_mass_kg * DESIGN.proximal_length_m
    )
    own = DESIGN.gravity_mps2 * at_knee * np.cos(phi)
    force = np.linalg.solve(np.swapaxes(jacobian(phi, DESIGN), 1, 2), (tau - own)[..., None])
    new = angles(h)
    at_knee = at_knee + 0.5 * DESIGN.rod_mass_kg * lengths[0] * np.eye(3)[joint]
    loaded = np.linalg.solve(np.swapaxes(inverse, 1, 2), force)[..., 0]
    return new, loaded + DESIGN.gravity_mps2 * at_knee * np.cos(new)


def spoiled(case, cause, robot, joint, values):
    """The signals with an error in them."""
    s = case.signals
    phi, theta, tau = s.phi[:, robot], s.theta[:, robot], s.tau[:, robot]
    if cause == "phi_zero":
        phi = with_joint(phi, joint, phi[:, joint] + values[0])
    elif cause == "theta_zero":
        theta = with_joint(theta, joint, theta[:, joint] + values[0])
    elif cause == "sea_bias":
        tau = with_joint(tau, joint, tau[:, joint] + values[0])
    elif cause == "sea_scale":
        tau = with_joint(tau, joint, tau[:, joint] / (1.0 + values[0]))
    elif cause == "sea_hardening":
        tau = with_joint(tau, joint, hardened(tau[:, joint], values[0]))
    elif cause == "sea_hysteresis":
        reading = tau[:, joint] - values[0] * np.clip(rate_of(tau[:, joint]) / 0.2, -1, 1)
        tau = with_joint(tau, joint, reading)
    elif cause == "joint_friction":
        rate = rate_of(phi[:, joint])
        reading = tau[:, joint] + values[0] * np.clip(rate / 1e-3, -1, 1) + values[1] * rate
        tau = with_joint(tau, joint, reading)
    elif cause == "torque_skew":
        tau = resampled(tau, values[0])
    elif cause == "torque_lag":
        tau = lagged(tau, values[0])
    elif cause == "sensor_lag":
        tau = with_joint(tau, joint, lagged(tau[:, joint], values[0]))
    elif cause == "clock_delay":
        phi, theta, tau = (resampled(x, values[0]) for x in (phi, theta, tau))
    elif cause == "link_length":
        phi, tau = other_leg(case, robot, joint, values)
    return replace(
        s, phi=put(s.phi, robot, phi), theta=put(s.theta, robot, theta), tau=put(s.tau, robot, tau)
    )


READINGS = {
    "phi_zero": [1e-4],
    "theta_zero": [1e-4],
    "sea_bias": [0.01],
    "sea_scale": [1e-3],
    "sea_hardening": [5.0],
    "sea_hysteresis": [0.02],
    "joint_friction": [0.02, 0.01],
    "torque_skew": [2e-3],
    "torque_lag": [2e-3],
    "sensor_lag": [2e-3],
    "clock_delay": [5e-4],
    "link_length": [1e-4, -5e-5, 8e-5],
}
# link_length takes what hangs at the knees for a part of the load on the wrist: a tenth of its small wrench.
TOLERANCE = {
    "link_length": 0.01,
    "joint_friction": 0.04,
    "sea_hysteresis": 0.03,
    "torque_lag": 0.02,
    "sensor_lag": 0.02,
}


# Channels of one unit, with what filtering leaves: rotations, positions, force, moment.


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", READINGS)
def test_columns_are_what_the_error_adds(case, name, robot):
    cause, values = CAUSES[name], np.array(READINGS[name])
    for joint in range(3) if cause.per == "joint" else (0,):
        signals = spoiled(case, name, robot, joint, values)
        exact_change = residual_of(case, signals) - case.linear.residual
        column = cause.columns(case.linear, robot, joint, cause.shapes[0])
        assert column.shape == (*case.linear.residual.shape, len(values))
        assert np.abs(exact_change).max() > 1e-5
        assert_close(column @ values, exact_change, TOLERANCE.get(name, 0.01))
        if np.abs(exact_change[:, :12]).max() > 1e-6:
            assert_close((column @ values)[:, :12], exact_change[:, :12], 0.01)
        for k, value in enumerate(values):
            if len(values) > 1:
                single = np.zeros(len(values))
                single[k] = value
                change = residual_of(case, spoiled(case, name, robot, joint, single)) - case.linear.residual
                assert_close(column[..., k] * value, change, TOLERANCE.get(name, 0.01))


def test_friction_that_gives_way_before_it_slips(case):
    """A spring and a slider in series, step by step: it bends with the torque, never by more than its limit."""
    cause, robot, joint, gives, friction = CAUSES["sea_hysteresis"], 1, 2, 0.1, 0.02
    bent, states = 0.0, []
    for step in np.diff(case.signals.tau[:, robot, joint], prepend=case.signals.tau[0, robot, joint]):
        bent = min(max(bent + step / gives, -1.0), 1.0)
        states.append(bent)
    assert np.abs(states).max() == 1.0
    assert np.mean(np.abs(states) < 0.9) > 0.1
    tau = case.signals.tau.copy()
    tau[:, robot, joint] -= friction * np.array(states)
    changed = residual_of(case, replace(case.signals, tau=tau)) - case.linear.residual
    shape = {"presliding_Nm": gives}
    assert_close(cause.columns(case.linear, robot, joint, shape) @ [friction], changed, 0.03)
    physical = cause.physical(np.array([friction]), SimpleNamespace(shape=shape))
    assert physical == {"friction_Nm": friction, "presliding_Nm": gives}


def test_how_far_friction_was_bent_before_is_open_until_it_slips(case):
    cause, tau = CAUSES["sea_hysteresis"], case.signals.tau[:, 1, 2]
    gives = 0.45 * np.ptp(tau)
    before = dense(cause.unknowns(case.linear, 1, 2, {"presliding_Nm": gives}))[..., 0]
    first = case.signals.time[np.flatnonzero(np.abs(tau - tau[0]) > gives)[0]]
    late = case.linear.reduction.time > first + 0.5
    assert 0.05 < np.mean(~late) < 0.95
    assert np.abs(before[late]).max() < 1e-3 * np.abs(before).max()


def test_friction_that_gives_way_need_not_do_so_in_proportion(case):
    """Half its limit is open while Prandtl's has not slipped, which is most of what Dahl's, integrated, differs by."""
    cause, tau = CAUSES["sea_hysteresis"], case.signals.tau[:, 1, 2]
    gives = 0.15 * np.ptp(tau)
    shape, dahl, slider = {"presliding_Nm": gives}, np.zeros(len(tau)), np.zeros(len(tau))
    for k, step in enumerate(-np.diff(tau) / gives):
        # z' = x' (1 - z sign x'), in closed form while x goes one way; and a spring behind a slider.
        dahl[k + 1] = np.sign(step) + (dahl[k] - np.sign(step)) * np.exp(-abs(step))
        slider[k + 1] = np.clip(slider[k] + step, -1.0, 1.0)

    def trace(torque):
        return case.linear.of_signals(1, tau=torque[:, None] * [0.0, 0.0, 1.0])

    opened = dense(cause.unknowns(case.linear, 1, 2, shape))
    holds = trace((np.abs(slider) < 1.0).astype(float))
    assert np.linalg.norm(opened[..., 1:].sum(axis=-1) - 0.5 * holds) < 0.05 * np.linalg.norm(0.5 * holds)
    flat, missing = opened.reshape(-1, opened.shape[2]), (trace(dahl) - trace(slider)).ravel()
    ridge = 0.05 * np.abs(flat).max() * np.eye(flat.shape[1])
    values = np.linalg.lstsq(np.vstack([flat, ridge]), np.append(missing, 0.0 * ridge[0]), rcond=None)[0]
    assert np.linalg.norm(missing - flat @ values) < 0.45 * np.linalg.norm(missing)


def test_clocks_late_by_as_much_are_nothing(case):
    """Beside another error, here friction: what that adds is made of the same readings, and late, too."""
    s, late_s, coulomb = spoiled(case, "joint_friction", 1, 0, [0.05, 0.0]), 0.02, np.array([0.05, 0.0])
    late = Signals(s.time, *(resampled(x, late_s) for x in (s.phi, s.theta, s.tau)), s.rate_hz)
    linear = linearise(late, case.shared, case.bases, DESIGN, case.reduction, full=True)
    friction = CAUSES["joint_friction"].columns(linear, 1, 0, CAUSES["joint_friction"].shapes[0]) @ coulomb
    left = np.linalg.norm((linear.residual - friction)[5:-5, -6:], axis=0)
    each = [CAUSES["clock_delay"].columns(linear, robot, 0, {}) for robot in range(3)]
    assert np.abs(np.sum(each, axis=0)).max() < 1e-9 * np.abs(each).max()
    shift = sum(Late.columns(CAUSES["clock_delay"], linear, robot, 0, {}) for robot in range(3))[..., 0]
    assert np.linalg.norm(left) < 0.2 * np.linalg.norm(late_s * shift[5:-5, -6:])


@pytest.mark.parametrize("name", READINGS)
def test_undo_takes_the_error_out_again(case, name):
    """Several times the size of above: what is left is of second order."""
    cause, robot, joint = CAUSES[name], 1, 2
    # Friction in a spring shows in the very reading that tells its direction: little of it only.
    values = (0.1 if name == "sea_hysteresis" else 10.0) * np.array(READINGS[name])
    share = {"link_length": 0.01, "sea_hysteresis": 0.1}.get(name, 0.03)
    signals = spoiled(case, name, robot, joint, values)
    restored = cause.undo(signals, case.linear, robot, joint, values, cause.shapes[0])
    for field in ("phi", "theta", "tau"):
        error = getattr(signals, field) - getattr(case.signals, field)
        left = (getattr(restored, field) - getattr(case.signals, field))[200:-200]
        if name == "link_length" and field == "phi":
            assert np.abs(left).max() <= 0.02 * np.abs(error).max()
        assert np.sqrt(np.mean(left**2)) <= share * np.sqrt(np.mean(error**2)) + 1e-9
    without = cause.undo(signals, case.linear, robot, joint, np.zeros(len(values)), cause.shapes[0])
    np.testing.assert_array_equal(without.tau, signals.tau)
    np.testing.assert_array_equal(without.phi, signals.phi)


@pytest.mark.parametrize("name", sorted(set(CAUSES) - set(READINGS) - {"encoder_play"}))
def test_causes_that_are_no_errors_of_readings_leave_signals_alone(case, name):
    cause = CAUSES[name]
    values = np.ones(len(cause.parameters))
    shape = cause.shapes[0] or {"start_s": 5.0, "duration_s": 1.0}
    assert cause.undo(case.signals, case.linear, 0, 0, values, shape) is None


def test_friction_at_rest_takes_any_force_that_passes_the_filter(case):
    """A joint stands still from 6 s to 8 s: a torque that changes then is an unknown, and none while it moves on."""
    s = case.signals
    frozen = s.phi.copy()
    start, stop = 600, 800
    frozen[start:stop, 1, 0] = frozen[start, 1, 0]
    frozen[stop:, 1, 0] += frozen[start, 1, 0] - s.phi[stop, 1, 0]
    still = replace(s, phi=frozen)
    linear = replace(case.linear, signals=still, s=filtered(still))
    cause = CAUSES["joint_friction"]
    unknowns = dense(cause.unknowns(linear, 1, 0, {"slow_rad_per_s": 1e-3}))
    moves = dense(cause.unknowns(case.linear, 1, 0, {"slow_rad_per_s": 1e-3}))
    assert moves.shape[2] + 30 < unknowns.shape[2] <= moves.shape[2] + 42  # 2 s, a knot every twentieth
    added = unknowns.reshape(-1, unknowns.shape[2])
    since = np.linspace(0.0, 2.0, stop - start - 10)
    for force in (np.ones_like(since), 1.0 - 0.35 * since, np.cos(8.0 * np.pi * since)):
        torque = np.zeros((len(s.time), 3))
        torque[start + 5 : stop - 5, 0] = force
        expected = case.linear.of_signals(1, tau=torque).ravel()
        left = expected - added @ np.linalg.lstsq(added, expected, rcond=None)[0]
        assert np.linalg.norm(left) < 0.15 * np.linalg.norm(expected)


def test_a_joint_that_turns_twice_in_the_play_of_its_encoder_leaves_its_place_open(case):
    """While the reading stands still, the joint crosses the play and comes back; elsewhere the law is right."""
    s, half, (start, stop) = case.signals, 1.5e-3, (700, 780)
    time = np.arange(len(s.time)) / RATE
    angle = 0.1 * np.sin(time)
    angle[stop:] += angle[start] - angle[stop]
    angle[start:stop] = angle[start] - 1.8 * half * np.sin(np.linspace(0.0, np.pi, stop - start)) ** 2
    loose = [angle[0]]
    for x in angle[1:]:
        loose.append(min(max(loose[-1], x - half), x + half))
    read = replace(s, theta=put(s.theta, 1, with_joint(s.theta[:, 1], 2, np.array(loose))))
    linear, cause = replace(case.linear, signals=read), CAUSES["encoder_play"]
    (law,) = cause.errors(read, 1, 2, {}, DESIGN)
    beyond = np.array(loose) - angle - 2.0 * half * law["theta"][:, 2]
    expected = case.linear.of_signals(1, theta=np.outer(beyond, [0.0, 0.0, 1.0])).ravel()
    unknowns = dense(cause.unknowns(linear, 1, 2, {}))
    added = unknowns.reshape(-1, unknowns.shape[2])
    left = expected - added @ np.linalg.lstsq(added, expected, rcond=None)[0]
    assert np.abs(beyond).max() > 1.7 * half
    assert np.linalg.norm(left) < 0.15 * np.linalg.norm(expected)
    assert unknowns.shape[2] < 0.3 * len(time) / RATE / 0.05  # knots everywhere would be three times as many


def team_of(case, robots):
    """A team of any size from the robots at hand; it need not be in balance."""
    which = [(0, 1, 2, 1, 2)[k] for k in range(robots)]
    s, grasps = case.signals, case.shared.grasps
    nothing = np.zeros((robots, robots))
    held = GraspEstimate(
        grasps.R_1i[which], grasps.p_1i[which] + 0.05 * np.arange(robots)[:, None], np.zeros((6 * robots - 6,) * 2),
        nothing, nothing, np.zeros(robots), np.zeros(robots),
    )  # fmt: skip
    signals = Signals(s.time, s.phi[:, which], s.theta[:, which], s.tau[:, which], s.rate_hz)
    bases = Bases(case.bases.R[which], case.bases.p[which])
    shared = Shared(held, case.shared.pi)
    linear = linearise(signals, shared, bases, DESIGN, Reduction.of(signals), full=True)
    return TeamRig((), Sensed(None, (lambda x: x,), ()), (linear,), default_tolerances(), frozenset())


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_every_cause_has_finite_columns_and_an_effect(case, robots):
    rig = team_of(case, robots)
    candidates = [*rig.candidates(), CAUSES["push"].event({}, Transient(0, 5.0, 1.0))]
    per = {"joint": 3 * robots, "robot": robots, "payload": 1}
    undecidable = robots  # the zero of every last gimbal axis
    assert len(candidates) == sum(per[CAUSES[name].per] for name in CAUSES) - undecidable
    assert len({c.key for c in candidates}) == len(candidates)
    assert len(rig.channels) == rig.linear[0].channels == 6 * robots
    assert rig.local_unknowns == 4 * (robots - 1)
    rng = np.random.default_rng(8)
    for candidate in candidates:
        if robots == 5 and candidate.robot not in (None, 1, 5):
            continue
        columns = rig.columns(candidate)[0]
        k = len(candidate.parameters)
        assert columns.shape == (len(rig.linear[0].reduction.time), 6 * robots, k)
        assert np.all(np.isfinite(columns))
        values = candidate.units * rng.uniform(0.5, 2.0, k)
        (effect,) = rig.effects(candidate, values)
        assert effect.cause == candidate.cause
        place = getattr(effect, "robot", None), getattr(effect, "joint", None)
        assert place == (candidate.robot, candidate.joint)


def test_no_cause_is_silent(case):
    """Every number shows, in one shape or another."""
    rig = team_of(case, 2)
    for candidate in rig.candidates():
        cause = CAUSES[candidate.cause]
        others = [*cause.shapes, *cause.further(candidate.shape)]
        shapes = [candidate, *in_shapes(candidate, others, 1)]
        sizes = [np.abs(rig.columns(shape)[0]).max(axis=(0, 1)) * candidate.units for shape in shapes]
        assert np.all(np.max(sizes, axis=0) > 1e-8), candidate.label


def test_catalogue_is_complete():
    assert set(CAUSES) == set(EFFECTS) - {"law", "zero_scatter"}  # what no catalogue lists
    for name, cause in CAUSES.items():
        assert cause.name == name
        assert cause.separate
        place = set(EFFECTS[name].place_names())
        assert place == {"joint": {"robot", "joint"}, "robot": {"robot"}, "payload": set()}[cause.per]
        if cause.tolerances:
            assert len(cause.tolerances) == len(cause.parameters)
            assert not cause.scales
        else:
            assert len(cause.scales) == len(cause.parameters)


def test_negative_friction_is_no_effect_but_none(case):
    rig = team_of(case, 2)
    candidate = next(c for c in rig.candidates() if c.cause == "joint_friction")
    (effect,) = rig.effects(candidate, np.array([-0.1, 0.2]))
    assert (effect.coulomb_Nm, effect.viscous_Nms_per_rad) == (0.0, 0.2)
    with_negative = next(c for c in rig.candidates() if c.cause == "grasp_play")
    assert rig.effects(with_negative, np.array([-1e-4])) is None


def test_standard_errors_of_derived_parameters():
    """Delta method against draws: stiffness and anchor of a tether."""
    rng = np.random.default_rng(2)
    values = np.array([4.0, -3.0, 5.0, 20.0])
    root = 0.02 * rng.standard_normal((4, 4)) * values
    covariance = root.T @ root
    context = Context(np.zeros(3), 0.4, {}, None)
    physical, se = CAUSES["tether"].report(values, covariance, context)
    draws = [CAUSES["tether"].physical(values + root.T @ z, context) for z in rng.standard_normal((4000, 4))]
    for name in physical.keys() - {"length_m", "stiffening_N_per_m2"}:
        assert se[name] == pytest.approx(np.std([d[name] for d in draws]), rel=0.06)
    assert physical["length_m"] == 0.0
    assert np.isnan(se["length_m"])  # a spring's was chosen
    assert physical["anchor_z_m"] == pytest.approx(5.0 / 20.0 + 0.4)
    _, se = CAUSES["slosh"].report(
        np.array([0.3, 0.0, 0.0, 0.0]), 1e-4 * np.eye(4), Context(np.zeros(3), 0.4, {"length_m": 0.2}, None)
    )
    assert np.isnan(se["length_m"])
    assert se["mass_kg"] == pytest.approx(0.01)
    of_shape = np.diag([1e-4, 1e-4, 1e-4, 1e-4, 4e-6, 9e-6])
    context = Context(np.zeros(3), 0.4, {"length_m": 0.2, "damping_ratio": 0.05}, None)
    _, se = CAUSES["slosh"].report(np.array([0.3, 0.0, 0.0, 0.0]), of_shape, context)
    assert se["length_m"] == pytest.approx(2e-3)
    assert se["damping_ratio"] == pytest.approx(3e-3)
    assert se["mass_kg"] == pytest.approx(0.01)


def test_standard_errors_of_a_cable():
    """Of anchor, length and point, with what its shape leaves open: delta method against draws."""
    shape = dict(side=3.0, turn_1=0.3, turn_2=-0.2, stretch_m=0.02, near_per_m=1.2)
    rng = np.random.default_rng(4)
    for name, more in (
        ("tether", {"stiffens_per_m": 20.0}),
        ("payload_tether", {"offset_1_m": 0.1, "offset_2_m": -0.2, "stiffens_per_m": 4.0}),
    ):
        cause, own = CAUSES[name], shape | more
        root = 0.01 * rng.standard_normal((4 + len(own) - 1, 4 + len(own) - 1))
        root[:, :3] = 0.0  # no force at home is a parameter of it
        values, context = np.array([0.0, 0.0, 0.0, 6.0]), Context(np.array([0.1, 0.2, 0.0]), 0.4, own, None)
        _, se = cause.report(values, root.T @ root, context)
        draws = []
        for z in rng.standard_normal((4000, len(root))):
            step = root.T @ z
            named = [n for n in cause.determined if n in own]
            moved = own | {n: own[n] + x for n, x in zip(named, step[4:], strict=True)}
            draws.append(cause.physical(values + step[:4], replace(context, shape=moved)))
        for key, error in se.items():
            assert error == pytest.approx(np.std([d[key] for d in draws]), rel=0.08), (name, key)


def test_finer_pendulums_stay_within_reach():
    shape = {"length_m": 0.97, "damping_ratio": 0.28}
    for _ in range(3):
        near = CAUSES["slosh"].finer(shape)
        assert near
        assert all(0.04 <= s["length_m"] <= 1.0 and s["damping_ratio"] <= 0.3 for s in near)
        shape = max(near, key=lambda s: (s["damping_ratio"], s["length_m"]))
