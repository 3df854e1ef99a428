"""The independent generator: its mechanics against energy and momentum, and the product's estimator on it."""

import numpy as np
import pytest

from estimator.arm.design import load_design
from estimator.recording.parquet import write_recording
from independent.arm import OUT, Legs, arm_load, driven_angles, legs_of, link_directions, wrist_position
from independent.bodies import MODELS, draw_as_built, load_payload
from independent.draw import FORMS, NAMES, PLAIN
from independent.effects import Pendulum, Push
from independent.generate import generate, spring_readings
from independent.numerics import (
    FINE_HZ,
    bristles,
    coulomb,
    derivative,
    lagged,
    parallel_dahl,
    play,
    second_derivative,
)
from independent.team import Truth, carry, place_bases, random_motion, scene_of

DESIGN = load_design(MODELS / "omnid" / "design.toml")
LEGS = Legs(
    np.array([0.118, 0.119, 0.1172]), np.array([0.2, 0.201, 0.1995]), np.array([0.368, 0.3675, 0.369])
)
GRAVITY = np.array([0.3, -0.2, -9.8])
INSIDE = slice(20, -20)
PAIR = ("periodic", "random")


@pytest.fixture(scope="module")
def wrist() -> np.ndarray:
    """A wrist that moves, in the arm's frame [m], shape (Q, 3)."""
    motion = random_motion(np.random.default_rng(3), 14.0)
    return np.array([0.01, -0.02, 0.35]) + motion.shift


def carried(*effects, background="none", hidden=None) -> Truth:
    """A trial of payload (d), whose grasps differ in height."""
    rng = np.random.default_rng(5)
    payload = load_payload("d")
    bases = place_bases(rng, payload, DESIGN)
    scene = scene_of(1, random_motion(rng, 14.0), payload, bases, DESIGN)
    robots = draw_as_built(rng, background)
    for (quantity, robot, place), value in (hidden or {}).items():
        robots[quantity][robot, place] = value
    return carry(rng, scene, DESIGN, robots, effects, squeezing=True)


@pytest.fixture(scope="module")
def clean() -> Truth:
    return carried()


def test_driven_angles_and_wrist_are_inverses(wrist):
    phi = driven_angles(wrist, LEGS)
    assert np.abs(wrist_position(phi, LEGS, np.array([0.0, 0.0, 0.35])) - wrist).max() < 1e-13
    along, _ = link_directions(phi)
    rods = wrist[:, None] - LEGS.radius[:, None] * OUT - LEGS.proximal[:, None] * along
    assert np.abs(np.linalg.norm(rods, axis=-1) - LEGS.rod).max() < 1e-14
    home = driven_angles(np.array([[0.0, 0.0, DESIGN.home_height_m]]), legs_of(DESIGN, *np.zeros((3, 3))))
    assert home == pytest.approx(0.6230299772752583, abs=1e-12)  # models/omnid/README.md


def test_springs_do_the_work_that_energy_and_payload_take(wrist):
    """Power balance with rods of mass points at Gauss's abscissae, which integrate what is quadratic exactly."""
    rng = np.random.default_rng(1)
    force = rng.normal(0, 20, 3) + 5 * np.sin(np.arange(len(wrist))[:, None] / FINE_HZ * [1.0, 2.0, 3.0])
    load = arm_load(wrist, LEGS, DESIGN, np.broadcast_to(GRAVITY, wrist.shape))
    tau = load.spring_torque(force)
    along, _ = link_directions(load.phi)
    knees = LEGS.radius[:, None] * OUT + LEGS.proximal[:, None] * along
    abscissae, weights = np.polynomial.legendre.leggauss(3)
    moving = [(DESIGN.wrist_mass_kg, wrist)]
    for leg in range(3):
        for s, w in zip((abscissae + 1) / 2, weights / 2, strict=True):
            moving.append((DESIGN.rod_mass_kg * w, (1 - s) * knees[:, leg] + s * wrist))
    energy = sum(m * ((derivative(x) ** 2).sum(-1) / 2 - x @ GRAVITY) for m, x in moving)
    centres = LEGS.radius[:, None] * OUT + DESIGN.proximal_com_m * along
    energy = energy + (DESIGN.proximal_inertia_kgm2 * derivative(load.phi) ** 2 / 2).sum(-1)
    energy -= DESIGN.proximal_mass_kg * (centres @ GRAVITY).sum(-1)
    given = (tau * derivative(load.phi)).sum(-1)
    taken = derivative(energy) + (force * derivative(wrist)).sum(-1)
    assert np.abs(taken).max() > 0.5
    assert np.abs(given - taken)[INSIDE].max() < 1e-7


def test_at_rest_the_springs_are_the_gradient_of_the_weight():
    """All three directions at once, where a power balance sees only the one of the motion."""
    h, step = np.array([0.03, -0.02, 0.33]), 1e-5

    def weight(place):
        phi = driven_angles(place[None], LEGS)
        along, _ = link_directions(phi)
        centres = LEGS.radius[:, None] * OUT + DESIGN.proximal_com_m * along[0]
        knees = LEGS.radius[:, None] * OUT + LEGS.proximal[:, None] * along[0]
        total = DESIGN.proximal_mass_kg * centres.sum(0) + DESIGN.wrist_mass_kg * place
        return -(total + DESIGN.rod_mass_kg * (knees + place).sum(0) / 2) @ GRAVITY

    load = arm_load(np.tile(h, (30, 1)), LEGS, DESIGN, np.tile(GRAVITY, (30, 1)))
    tau = load.spring_torque(np.zeros((30, 3)))[0]
    for axis in np.eye(3) * step:
        angles = driven_angles(np.stack([h + axis, h - axis]), LEGS)
        assert tau @ (angles[0] - angles[1]) == pytest.approx(weight(h + axis) - weight(h - axis), abs=1e-11)
    mass = DESIGN.wrist_mass_kg + 3 * (DESIGN.rod_mass_kg + DESIGN.proximal_mass_kg)
    assert load.floor[0] == pytest.approx(-mass * GRAVITY, rel=1e-12)


def test_wrenches_of_the_robots_are_the_change_of_momentum(clean):
    """About W's origin, so without the balance's own reference point."""
    scene, payload = clean.scene, clean.scene.payload
    centre = scene.place(payload.p_1c)
    weight = payload.mass_kg * scene.gravity
    momentum = payload.mass_kg * derivative(centre)
    axes = scene.R_W1
    spin = np.einsum("qij,jk,qlk,ql->qi", axes, payload.inertia, axes, scene.omega)
    about_origin = derivative(np.cross(centre, momentum) + spin)
    moments = np.cross(clean.wrist, clean.force).sum(1) + clean.moment.sum(1) + np.cross(centre, weight)
    assert np.abs(derivative(momentum) - clean.force.sum(1) - weight)[INSIDE].max() < 1e-6
    assert np.abs(about_origin - moments)[INSIDE].max() < 1e-6
    assert 0 < np.abs(clean.moment).max() < 0.05


def test_gimbals_are_passive(clean):
    """Their moments on the payload do the work that their bodies' energy takes."""
    work = energy = 0.0
    for i in range(3):
        R_Wb, theta = clean.scene.R_Wb[i], clean.theta[:, i]
        z, y = theta[:, 0], theta[:, 1]
        second = np.stack([-np.sin(z), np.cos(z), 0 * z], -1)
        third = np.stack([np.cos(z) * np.cos(y), np.sin(z) * np.cos(y), -np.sin(y)], -1)
        first, rate = np.array([0.0, 0.0, 1.0]), derivative(theta)
        turns = np.cumsum([rate[:, :1] * first, rate[:, 1:2] * second, rate[:, 2:] * third], axis=0)
        work = work - np.einsum("qi,ij,qj->q", clean.moment[:, i], R_Wb, turns[2])
        x = theta[:, 2]
        # Rates about a body's own axes, written out.
        own_ring = np.stack([-rate[:, 0] * np.sin(y), rate[:, 1], rate[:, 0] * np.cos(y)], -1)
        across = own_ring[:, 1] * np.cos(x) + own_ring[:, 2] * np.sin(x)
        upward = -own_ring[:, 1] * np.sin(x) + own_ring[:, 2] * np.cos(x)
        own_flange = np.stack([own_ring[:, 0] + rate[:, 2], across, upward], -1)
        bodies = ((DESIGN.ring_inertia_kgm2, own_ring), (DESIGN.flange_inertia_kgm2, own_flange))
        energy = energy + DESIGN.yoke_inertia_kgm2[2] * rate[:, 0] ** 2 / 2
        energy = energy + sum((own**2 @ np.asarray(moments)) / 2 for moments, own in bodies)
    assert np.abs(work).max() > 1e-6
    assert np.abs(work - derivative(energy))[INSIDE].max() < 1e-9


def test_the_same_seed_gives_the_same_bits():
    first, again, other = (generate(s, "x1", [("sea_bias", 3.0)], "a", kinds=PAIR)[0] for s in (4, 4, 5))
    for field in ("time", "phi", "theta", "tau"):
        assert all((getattr(x, field) == getattr(y, field)).all() for x, y in zip(first, again, strict=True))
    assert not np.array_equal(first[0].tau, other[0].tau)


@pytest.mark.parametrize("payload", ["b", "c"])
def test_the_estimator_finds_the_payload(payload):
    """Two derivations that share nothing: it takes both to be right."""
    import mocobot

    body = load_payload(payload)
    estimate = mocobot.estimate(generate(2, "none", [], payload, ideal=True)[0])
    assert estimate.mass.mass == pytest.approx(body.mass_kg, rel=1e-7)
    assert np.abs(np.asarray(estimate.p_1c) - body.p_1c).max() < 1e-6
    assert np.abs(np.asarray(estimate.inertia.inertia) - body.inertia).max() < 1e-5
    assert np.abs(np.asarray(estimate.grasps.p_1i) - body.p_1i).max() < 1e-6
    assert np.abs(np.asarray(estimate.grasps.R_1i) - body.R_1i).max() < 1e-6


def test_zeros_and_biases_are_added_to_the_readings():
    plain, _ = generate(6, "none", [], "b", ideal=True, kinds=PAIR)
    for name, field in (("phi_zero", "phi"), ("theta_zero", "theta"), ("sea_bias", "tau")):
        shifted, truth = generate(6, "none", [(name, 4.0)], "b", ideal=True, kinds=PAIR)
        answer = truth["effects"][0]["answer"]
        (value,) = answer["known"].values()
        expected = np.zeros((3, 3))
        expected[answer["robot"] - 1, answer["joint"] - 1] = value
        for a, b in zip(shifted, plain, strict=True):
            assert np.abs(getattr(a, field) - getattr(b, field) - expected).max() < 1e-14


def test_springs_are_misread():
    robots = draw_as_built(np.random.default_rng(0), "none")
    torque = np.full((5, 3, 3), 8.0)
    robots["sea_scale"][0, 0], robots["sea_hardening"][0, 1] = 0.03, 50.0
    read = spring_readings(torque, robots, (), DESIGN)[-1, 0] / DESIGN.sea_stiffness_Nm_per_rad
    assert read[0] == pytest.approx(8.0 / 103.0, rel=1e-14)
    assert 100.0 * read[1] + 50.0 * read[1] ** 3 == pytest.approx(8.0, rel=1e-14)
    assert read[2] == pytest.approx(0.08, rel=1e-14)


def test_a_push_takes_load_off_the_robots(clean):
    push = Push(1, 5.0, 3.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.0))
    difference = (carried(push).force - clean.force).sum(axis=1)
    during = (clean.scene.time > 5.01) & (clean.scene.time < 7.99)
    expected = -clean.scene.R_Wb[0] @ [1.0, 2.0, 3.0]
    assert np.abs(difference[during] - expected).max() < 1e-9
    assert np.abs(difference[clean.scene.time < 4.99]).max() < 1e-9


def test_friction_dissipates():
    """In the driven joint and in the gimbal: the springs do more work than without."""
    hidden = {("joint_coulomb", 0, 1): 0.05, ("gimbal_coulomb", 2, 1): 0.05}
    clean, rubbing = carried(), carried(hidden=hidden)
    lost = [(t.torque * derivative(t.phi)).sum((1, 2)) for t in (rubbing, clean)]
    ways = np.abs(derivative(clean.phi[:, 0, 1])), np.abs(derivative(clean.theta[:, 2, 1]))
    assert (lost[0] - lost[1]).sum() == pytest.approx(0.05 * sum(w.sum() for w in ways), rel=0.01)


def test_grasps_and_bases_give_way_along_their_force(clean):
    soft = carried(hidden={("grasp_flex", 1, 0): 1e-5})
    moved = soft.wrist[:, 1] - clean.wrist[:, 1]
    assert np.abs(moved - 1e-5 * soft.force[:, 1]).max() < 1e-3 * np.abs(moved).max()
    yielding = carried(hidden={("base_compliance", 1, 0): 1e-5})
    rest = 200
    # The floor is pushed by the reaction, so the wrist is farther along the force in {b}.
    shift = clean.scene.R_Wb[1] @ (yielding.h[rest, 1] - clean.h[rest, 1])
    expected = 1e-5 * yielding.force[rest, 1] * [1.0, 1.0, 0.0]
    assert np.abs(shift - expected).max() < 1e-9


def test_a_pendulum_pulls_with_its_weight_and_swings_at_its_period(clean):
    scene = clean.scene
    pendulum = Pendulum((0.1, 0.2, 0.0), 0.5, 0.25, 0.0)
    force, _ = pendulum.wrench(scene)
    assert force[0] == pytest.approx(0.5 * scene.gravity, abs=1e-9)
    # After the motion the bob's energy stays, and its swing is that of 0.25 m.
    at = scene.time > scene.time[-1] - 1.9
    n, n_dot, n_two = pendulum.swing(scene.gravity - scene.motion(np.array([0.1, 0.2, 0.0]))[1], scene)
    assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-8
    energy = 0.25 * (n_dot**2).sum(1) / 2 + DESIGN.gravity_mps2 * n[:, 2]
    assert np.ptp(energy[at]) < 1e-5 * DESIGN.gravity_mps2
    small = np.abs(n_two[at, 0] + DESIGN.gravity_mps2 / 0.25 * n[at, 0]).max()
    assert small < 0.1 * np.abs(n_two[at, 0]).max()


def test_operators_with_a_memory():
    time = np.arange(4000) / FINE_HZ
    x = np.sin(time)
    assert np.abs(derivative(x) - np.cos(time))[INSIDE].max() < 1e-11
    assert np.abs(second_derivative(x) + x)[INSIDE].max() < 1e-8
    follower = play(x[:, None], np.array([0.1]))[:, 0]
    assert np.abs(x - follower).max() == pytest.approx(0.1, abs=1e-15)
    late = lagged(x, 0.05)
    exact = (np.sin(time) - 0.05 * np.cos(time)) / (1 + 0.05**2)
    assert np.abs(late - exact)[500:].max() < 1e-6
    dry = coulomb(x[:, None], np.array([0.2]), 1e-4)[:, 0]
    soft = bristles(x, np.full(4000, 0.2), 1e-3)
    rate = np.cos(time)
    fast = np.abs(rate) > 0.1
    assert np.abs(dry - 0.2 * np.sign(rate))[fast][20:].max() < 1e-12
    assert np.abs(soft - 0.2 * np.sign(rate))[fast][20:].max() < 5e-3
    read = parallel_dahl(10 * x, 0.3, 0.2)
    assert (10 * x - read)[1:700].max() == pytest.approx(0.3, rel=0.01)


def test_everything_can_be_hidden_and_shows():
    """Each name once: drawn, finite, within the sensors' ranges, and not nothing."""
    from estimator.recording.checks import check_recording

    assert len(PLAIN) == 24
    assert {form.cause for form in FORMS.values()} < set(PLAIN)
    plain, _ = generate(9, "x1", [], "a", ideal=True, kinds=PAIR[::-1])
    names = list(NAMES)
    for k in range(0, len(names), 20):
        some = [(name, 3.0) for name in names[k : k + 20]]
        recordings, truth = generate(9, "x1", some, "a", ideal=True, kinds=PAIR[::-1])
        assert [e["cause"] for e in truth["effects"]] == names[k : k + 20]
        assert [e["answer"]["cause"] for e in truth["effects"]] == [NAMES[n].cause for n, _ in some]
        for recording in recordings:
            check_recording(recording)
        assert np.abs(recordings[1].tau - plain[1].tau).max() > 1e-3
    with pytest.raises(ValueError, match="cannot be hidden"):
        generate(9, "x1", [("gremlins", 1.0)], "a")


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "size"), [(113, 7.0), (2001, 6.34)])
def test_gimbal_friction_is_found_with_coarse_encoders(seed, size, tmp_path):
    """Of 14 and 16 bits whose readings scatter; the parallel axis of another robot moves alike."""
    import mocobot

    recordings, _ = generate(seed, "x1", [("gimbal_friction", size)], "b", noise="white", kinds=PAIR[::-1])
    files = [tmp_path / f"trial{k}.parquet" for k in range(len(recordings))]
    for recording, file in zip(recordings, files, strict=True):
        write_recording(recording, file)
    (cause,) = mocobot.diagnose(files, closed_loop=False).to_dict()["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("gimbal_friction", 2, 2)
    assert cause["probability"] > 0.9
    value = cause["parameters"]["coulomb_Nm"]
    assert value["value"] == pytest.approx(size * 0.017, abs=4.0 * value["se"])


@pytest.mark.slow
def test_a_strong_tether_is_found_beside_robots_that_nobody_calibrated(tmp_path):
    """What it pulls is taken for scales of springs as long as it is unknown, the more so with every linearisation."""
    import mocobot

    recordings, truth = generate(3009, "uncalibrated", [("tether", 3.0)], "b", noise="white", kinds=PAIR[1:])
    files = [tmp_path / f"trial{k}.parquet" for k in range(len(recordings))]
    for recording, file in zip(recordings, files, strict=True):
        write_recording(recording, file)
    (cause,) = mocobot.diagnose(files, closed_loop=False, laws="never").to_dict()["causes"]
    (hidden,) = truth["effects"]
    assert (cause["cause"], cause["robot"]) == ("tether", hidden["answer"]["robot"])
    value, true = cause["parameters"]["stiffness_N_per_m"], hidden["parameters"]["stiffness_N_per_m"]
    assert true > 10.0
    assert true == pytest.approx(value["value"], abs=4.0 * value["se"])
    assert value["se"] < 0.05 * true
