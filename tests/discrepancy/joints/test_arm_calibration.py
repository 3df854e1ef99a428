"""A robot calibrated from its joint logs, against MuJoCo, closed forms and repeated noise."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from discrepancy.joints.calibrated import as_found, to_dict, to_text, write_into
from discrepancy.joints.calibration import ArmCalibration, calibrate_arm
from discrepancy.joints.link_prior import LinkPrior, central, pseudo_inertia
from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import load_model
from estimator.errors import InputError
from followed_arm import arm_log, arm_model, both, rubs
from mocobot_logs.joints.joint_log import JointLog

MASSES = {"one": 3.6, "two": 1.9, "three": 1.5}
DRY_NM, VISCOUS, ROTOR_KGM2 = 0.4, 0.25, 0.06


def wrong(spec: mujoco.MjSpec) -> None:
    """The true arm: other masses, centres, rotors and friction than the model."""
    for body in spec.bodies[1:]:
        body.mass = MASSES[body.name]
        body.ipos = np.asarray(body.ipos) + np.array([0.02, -0.01, 0.015])
        body.inertia = 1.2 * np.asarray(body.inertia)
    for joint in spec.joints:
        joint.armature = ROTOR_KGM2
    rubs(DRY_NM, VISCOUS)(spec)


@pytest.fixture(scope="module")
def log() -> JointLog:
    return arm_log(wrong, seed=3)


@pytest.fixture(scope="module")
def found(tmp_path_factory, log) -> ArmCalibration:
    return calibrate_arm(arm_model(tmp_path_factory.mktemp("arm")), [log])


def value(found: ArmCalibration, place: str, name: str) -> tuple[float, float]:
    """Value and standard error of a parameter."""
    p = next(p for p in found.parameters if (p.place, p.name) == (place, name))
    return p.value, p.se


@pytest.mark.parametrize("joint", ["turn", "shoulder", "elbow"])
@pytest.mark.parametrize(("name", "true"), [("coulomb_Nm", DRY_NM), ("viscous_Nms_per_rad", VISCOUS)])
def test_friction_is_found_within_its_errors(found, joint, name, true):
    x, se = value(found, joint, name)
    assert abs(x - true) < 4.0 * se
    assert se < 0.1 * true


def test_held_out_torques_leave_only_noise(found):
    for one in found.held_out:
        assert np.all(one.calibrated < 1.5 * one.noise)  # MuJoCo rounds reversals off
        assert np.all(one.calibrated < 0.1 * one.model)
        assert np.all(one.calibrated < 1.02 * one.least_squares)


def test_mujoco_asks_for_the_true_torques_with_the_model_as_found(found):
    true = mujoco.MjSpec.from_string((found.model.path).read_text(encoding="utf-8"))
    wrong(true)
    rng = np.random.default_rng(8)
    moves = [rng.uniform(-1.5, 1.5, (3, 3)) for _ in range(20)]
    asked = [torques(spec.compile(), moves) for spec in (true, as_found(found)[0])]
    nominal = torques(found.model.source.copy().compile(), moves)
    left = np.sqrt(np.mean((asked[1] - asked[0]) ** 2, axis=0))
    assert np.all(left < 0.03 * np.sqrt(np.mean(asked[0] ** 2, axis=0)))
    assert np.all(left < 0.1 * np.sqrt(np.mean((nominal - asked[0]) ** 2, axis=0)))


def torques(model: mujoco.MjModel, moves: list[np.ndarray]) -> np.ndarray:
    """Inverse dynamics by MuJoCo, with rotors but without friction."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.dof_damping[:] = 0.0
    data, out = mujoco.MjData(model), []
    for q, dq, ddq in moves:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    return np.array(out)


def test_every_link_as_found_is_a_possible_body(found):
    model = as_found(found)[0].compile()
    for b in range(1, model.nbody):
        moments = np.sort(model.body_inertia[b])
        assert model.body_mass[b] > 0.0
        assert moments[0] > 0.0
        assert moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9)


def test_the_model_as_found_keeps_names_and_loads_from_its_folder(tmp_path, found):
    write_into(found, tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "as_found.xml"))
    given = found.model.model
    for kind, count in ((mujoco.mjtObj.mjOBJ_BODY, given.nbody), (mujoco.mjtObj.mjOBJ_JOINT, given.njnt)):
        names = [[mujoco.mj_id2name(m, kind, k) for k in range(count)] for m in (given, model)]
        assert names[0] == names[1]
    assert model.dof_frictionloss == pytest.approx(
        [value(found, j, "coulomb_Nm")[0] for j in found.model.joints], rel=1e-4
    )
    table = (tmp_path / "parameters.csv").read_text(encoding="utf-8").splitlines()
    assert table[0] == "place,parameter,model,found,se,determined"
    assert len(table) == 1 + len(found.parameters)


def test_standard_errors_are_the_scatter_over_noise(tmp_path, log):
    model = arm_model(tmp_path)
    short = cropped(log, 8.0)
    rng = np.random.default_rng(5)
    noisy = [
        replace(short, torque=short.torque + 0.05 * rng.standard_normal(short.torque.shape)) for _ in range(8)
    ]
    each = [calibrate_arm(model, [one]) for one in noisy]
    scatter = []
    for place in ("turn", "shoulder", "elbow"):
        for name in ("coulomb_Nm", "viscous_Nms_per_rad", "offset_Nm"):
            values = np.array([value(one, place, name) for one in each])
            scatter.append(np.std(values[:, 0], ddof=1) / np.mean(values[:, 1]))
    # Errors also hold how far friction may deviate from its law, so the scatter is below them, though not far.
    assert 0.3 < np.sqrt(np.mean(np.square(scatter))) < 1.2


def cropped(log: JointLog, seconds: float) -> JointLog:
    here = slice(0, round(seconds * log.rate_hz))
    return replace(log, time=log.time[here], q=log.q[here], torque=log.torque[here], usable=log.usable[here])


def test_a_first_rotor_and_the_inertia_about_its_axis_are_told_only_in_sum(found):
    vertical = [p for p in found.parameters if (p.place, p.name) == ("one", "inertia_zz_kgm2")]
    assert not vertical[0].determined
    sums = [c for c in found.combinations if ("turn", "armature_kgm2") in c.terms]
    assert sums
    assert all(c.terms[("one", "zz")] == pytest.approx(c.terms[("turn", "armature_kgm2")], rel=1e-3) for c in sums
               if ("one", "zz") in c.terms)  # fmt: skip


def test_a_pendulum_tells_its_moment_and_its_inertia_with_the_rotor(tmp_path):
    """For one hinge across gravity, torque = (I + rotor) ddq + m g c sin q: two numbers of twelve."""
    path = tmp_path / "pendulum.xml"
    path.write_text(
        '<mujoco><worldbody><body name="bob"><joint name="pin" axis="0 1 0"/><inertial mass="2" pos="0 0 -0.3" '
        'diaginertia="0.02 0.02 0.01"/></body></worldbody></mujoco>',
        encoding="utf-8",
    )
    model, rng = load_model(path), np.random.default_rng(1)
    t = np.arange(6000) / 250.0
    q = 0.9 * np.sin(2.2 * t) + 0.6 * np.sin(4.7 * t + 1.0)
    ddq = -0.9 * 2.2**2 * np.sin(2.2 * t) - 0.6 * 4.7**2 * np.sin(4.7 * t + 1.0)
    about, moment = 0.31, 0.75  # the model has 0.2 kg m^2 and 0.6 kg m
    torque = about * ddq + moment * 9.81 * np.sin(q) + 0.01 * rng.standard_normal(len(t))
    usable = np.ones(len(t), dtype=bool)
    log = replace(arm_log_of_one(), time=t, q=q[:, None], torque=torque[:, None], usable=usable)
    found = calibrate_arm(model, [log])
    (inertia,) = [
        c for c in found.combinations if ("pin", "armature_kgm2") in c.terms and ("bob", "yy") in c.terms
    ]
    assert inertia.value == pytest.approx(about, abs=max(4.0 * inertia.se, 2e-3))
    bob = central_of(found)
    assert bob[0] * bob[3] == pytest.approx(-moment, rel=5e-3)


def central_of(found: ArmCalibration) -> list[float]:
    return [p.value for p in found.parameters if p.place == "bob"]


def arm_log_of_one() -> JointLog:
    from mocobot_logs.joints.joint_log import Drive

    one, none = np.ones(1), np.full(1, np.nan)
    drive = Drive(
        one, np.eye(1), one, np.zeros(1, dtype=bool), "none", none, none, "torque", np.full(1, np.inf)
    )
    blank = np.zeros((2, 1))
    return JointLog("pendulum", np.arange(2.0), 250.0, blank, blank, None, None, ("pin",), drive, np.zeros(1),
                    np.ones(2, dtype=bool), 250.0)  # fmt: skip


def test_a_right_model_stays_right(tmp_path):
    model = arm_model(tmp_path, given=both(rubs(0.2, 0.1)))
    found = calibrate_arm(model, [arm_log(rubs(0.2, 0.1), seed=5)])
    off = [abs(p.value - p.model) / p.se for p in found.parameters if p.determined]
    assert max(off) < 4.0
    for one in found.held_out:
        assert np.all(one.calibrated < 1.1 * np.maximum(one.model, one.noise))


def test_the_text_begins_with_the_gain_and_json_is_complete(found):
    text, values = to_text(found), to_dict(found)
    assert text.startswith("The calibrated model leaves ")
    assert "Not determined by these logs" in text
    assert values["format"] == "mocobot-joint-calibration"
    assert set(values["held_out"]) == {"turn", "shoulder", "elbow"}
    assert len(values["parameters"]) == len(found.parameters)


def test_a_log_without_torques_is_refused(tmp_path, log):
    with pytest.raises(InputError, match="there are no torques, currents or duties"):
        calibrate_arm(arm_model(tmp_path), [replace(log, torque=None)])


def test_the_prior_has_the_slope_and_curvature_of_its_divergence(tmp_path):
    """Against differences of tr(P0^-1 P) - log det(P0^-1 P) - 4, written out."""
    prior = LinkPrior(Tree.of(arm_model(tmp_path).model), 2)
    rng, scale = np.random.default_rng(2), 1.0 / (16.0 * 0.3**2)

    def divergence(p: np.ndarray) -> float:
        ratio = np.linalg.solve(pseudo_inertia(prior.given), pseudo_inertia(p))
        return float(scale * (np.trace(ratio) - np.log(np.linalg.det(ratio)) - 4.0))

    p = prior.given * (1.0 + 0.02 * rng.standard_normal(10))
    size = 1e-5 * np.maximum(np.abs(p), 1e-3)
    value, gradient, hessian = prior.slopes(p)
    assert value == pytest.approx(divergence(p), rel=1e-9)
    steps = np.diag(size)
    slope = [(divergence(p + s) - divergence(p - s)) / (2.0 * size[k]) for k, s in enumerate(steps)]
    assert gradient == pytest.approx(slope, rel=1e-4, abs=1e-6 * np.max(np.abs(slope)))
    bend = [(prior.slopes(p + s)[1] - prior.slopes(p - s)[1]) / (2.0 * size[k]) for k, s in enumerate(steps)]
    assert hessian == pytest.approx(np.array(bend).T, rel=1e-3, abs=1e-6 * np.max(np.abs(hessian)))
    assert prior.slopes(prior.given)[0] == pytest.approx(0.0, abs=1e-9)
    mass, *_ = central(prior.given)
    assert prior.slopes(np.append([-mass], prior.given[1:]))[0] == np.inf


@pytest.mark.parametrize("rounds", [1, 8])
def test_a_fit_that_has_not_settled_says_how_far_it_still_moves(tmp_path, monkeypatch, log, rounds):
    monkeypatch.setattr("discrepancy.joints.calibration.ROUNDS", rounds)
    found = calibrate_arm(arm_model(tmp_path), [cropped(log, 8.0)])
    said = [note for note in found.notes if "has not settled" in note]
    assert len(said) == (rounds == 1)
    for note in said:
        steps = re.findall(r"last of its 1 steps still moved a value by (\S+) standard errors", note)
        largest = max(
            abs(p.value - p.model) / p.se for p in found.parameters if p.place in found.model.joints
        )
        assert float(steps[0]) >= 0.95 * largest  # the first step comes from the given model
        assert note in " ".join(to_text(found).split())


def falling(q: np.ndarray, v: np.ndarray, time: float) -> np.ndarray:
    """Dry friction that falls by 1 N m as a joint gets faster."""
    return 0.3 + np.exp(-np.abs(v))


def test_viscous_friction_at_its_bound_is_as_uncertain_as_its_law(tmp_path):
    """Friction falls with speed, so the nearest law has no viscous friction though the arm has."""
    found = calibrate_arm(arm_model(tmp_path), [arm_log(rubs(0.0, 0.2), 3, None, falling)])
    for joint in ("turn", "shoulder", "elbow"):
        x, se = value(found, joint, "viscous_Nms_per_rad")
        assert x == 0.0
        assert 3.0 * se > 0.2
