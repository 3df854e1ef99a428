"""Table I and the errors as the paper defines them, on cases worked by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.calibrate.calibration import CalibratedPayload
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import InertiaEstimate, principal_inertia
from estimator.estimate.result import PayloadEstimate, RecordingEstimate
from estimator.estimate.statics import MassEstimate
from mocobot_sim.paper.scoring import (
    PAYLOADS,
    payload_truth,
    printed_truth,
    published_errors,
    rotation_error_deg,
    score,
    score_fit,
)
from mocobot_sim.scene.as_built import AsBuilt


def rotvec(R):
    return np.rad2deg(Rotation.from_matrix(R).as_rotvec())


# ---- Table I ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAYLOADS)
def test_truth_is_table_i(name):
    truth, printed = payload_truth(name), printed_truth(name)
    T_12, T_23, T_31 = truth.T(1, 2), truth.T(2, 3), truth.T(3, 1)
    np.testing.assert_allclose(T_12[:3, 3], printed["p_12_m"], atol=1e-12)
    np.testing.assert_allclose(T_31[:3, 3], printed["p_31_m"], atol=1e-12)
    np.testing.assert_allclose(rotvec(T_12[:3, :3]), printed["R_12_deg"], atol=1e-9)
    np.testing.assert_allclose(rotvec(T_31[:3, :3]), printed["R_31_deg"], atol=1e-9)
    np.testing.assert_allclose(T_12 @ T_23 @ T_31, np.eye(4), atol=1e-12)
    # The derived entry agrees with the printed one to the table's rounding.
    np.testing.assert_allclose(T_23[:3, 3], printed["p_23_m"], atol=1.5e-3)
    np.testing.assert_allclose(rotvec(T_23[:3, :3]), printed["R_23_deg"], atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(truth.inertia), printed["principal_kgm2"], atol=1e-12)
    np.testing.assert_allclose(rotvec(truth.R_1c), printed["R_1c_deg"], atol=1e-9)
    assert truth.mass == printed["mass_kg"]
    assert list(truth.p_1c) == printed["p_1c_m"]


def test_numbers_of_the_paper_at_random_places():
    assert payload_truth("d").p_1i[1].tolist() == [-0.382, 0.800, -0.038]
    assert payload_truth("c").principal_moments.tolist() == [1.824, 2.438, 4.208]
    assert published_errors("a")["p31_percent"] == {"mean": 4.5, "std": 0.7}
    assert published_errors("d")["R23_deg"] == {"mean": 3.57, "std": 0.32}
    assert published_errors("b")["all"]["Izz"] == {
        "mean": 0.246,
        "std": 0.056,
        "percent": 4.4,
        "std_percent": 1.0,
    }
    assert [published_errors(name)["m_percent"] for name in PAYLOADS] == [0.9, 0.6, 1.1, 1.8]


@pytest.mark.parametrize("name", PAYLOADS)
def test_published_percentages_agree_with_table_i(name):
    """A slip in either table would show: percent = error / norm of the truth, to the printed digits."""
    truth, errors = payload_truth(name), published_errors(name)
    for i, j in ((1, 2), (2, 3), (3, 1)):
        length = np.linalg.norm(truth.T(i, j)[:3, 3])
        computed = 100 * errors[f"p{i}{j}_m"]["mean"] / length
        assert computed == pytest.approx(errors[f"p{i}{j}_percent"]["mean"], abs=0.12)
    assert 100 * errors["m_kg"] / truth.mass == pytest.approx(errors["m_percent"], abs=0.1)
    assert 100 * errors["p1c_m"] / np.linalg.norm(truth.p_1c) == pytest.approx(errors["p1c_percent"], abs=0.1)
    for moment, name_ in zip(truth.principal_moments, ("Ixx", "Iyy", "Izz"), strict=True):
        row = errors["all"][name_]
        assert 100 * row["mean"] / moment == pytest.approx(row["percent"], abs=0.11)
        assert 100 * row["std"] / moment == pytest.approx(row["std_percent"], abs=0.11)


def test_unknown_payload():
    with pytest.raises(InputError, match="no payload 'e' in the paper; it has a, b, c, d"):
        payload_truth("e")


# ---- scores -------------------------------------------------------------------------------------------------

TRUTH = payload_truth("a")


def grasp_estimate(turn_deg=(0, 0, 0), shift=(0, 0, 0)):
    """Frame {2} off by a turn about its own axes and a shift in {1}; frame {3} true."""
    R, p = TRUTH.R_1i.copy(), TRUTH.p_1i.copy()
    R[1] = R[1] @ Rotation.from_rotvec(turn_deg, degrees=True).as_matrix()
    p[1] = p[1] + shift
    nothing = np.zeros((3, 3))
    return GraspEstimate(R, p, np.zeros((12, 12)), nothing, nothing, np.ones(3), np.ones(3))


def inertia_estimate(errors):
    matrix = TRUTH.R_1c @ np.diag(TRUTH.principal_moments + errors) @ TRUTH.R_1c.T
    covariance = 1e-6 * np.eye(6)
    return InertiaEstimate(matrix, covariance, principal_inertia(matrix, covariance), False, 0.0, 1.0)


def estimate(recordings, mass=TRUTH.mass, p_1c=TRUTH.p_1c):
    return PayloadEstimate(
        "a", 3, "staged", None, MassEstimate(mass, 0.1, 0.0), p_1c, np.eye(3), None, (), tuple(recordings), ()
    )


def recording(trial, grasps=None, inertia=None):
    return RecordingEstimate(trial, trial, 60.0, 0, grasps, inertia)


def test_grasp_errors_are_means_of_norms_over_random_trials():
    recordings = [
        recording("random", grasp_estimate((3.0, 0, 0), (0.003, 0.004, 0))),
        recording("random", grasp_estimate((0, -1.0, 0), (0, 0, -0.001))),
        recording("periodic", grasp_estimate((50, 0, 0), (1, 0, 0))),
        recording("static", grasp_estimate((50, 0, 0), (1, 0, 0))),
        recording("random"),
    ]
    result = score(estimate(recordings), TRUTH)
    # Errors 3 and 1 deg, 5 and 1 mm; sample standard deviation of two numbers is their distance / sqrt 2.
    assert result["R12_deg"] == pytest.approx({"mean": 2.0, "std": np.sqrt(2)})
    assert result["p12_m"] == pytest.approx({"mean": 0.003, "std": 0.004 / np.sqrt(2)})
    length = np.hypot(0.647, 0.533)
    assert result["p12_percent"]["mean"] == pytest.approx(0.3 / length)
    assert result["p12_percent"]["std"] == pytest.approx(0.4 / np.sqrt(2) / length)
    assert result["R23_deg"]["mean"] == pytest.approx(2.0)
    assert result["R31_deg"]["mean"] == pytest.approx(0, abs=1e-9)
    assert result["p31_m"]["mean"] == pytest.approx(0, abs=1e-12)


def test_mass_and_centre_of_mass():
    result = score(estimate([], TRUTH.mass - 0.11, TRUTH.p_1c + np.array([0.012, 0, -0.016])), TRUTH)
    assert result["m_kg"] == pytest.approx(0.11)
    assert result["m_percent"] == pytest.approx(100 * 0.11 / 11.672)
    assert result["p1c_m"] == pytest.approx(0.020)
    assert result["p1c_percent"] == pytest.approx(100 * 0.020 / np.sqrt(0.537**2 + 0.156**2 + 0.072**2))


def test_inertia_errors_are_bias_and_scatter():
    """Signed errors of +0.1 and -0.3: the mean error is 0.1 in magnitude, not 0.2."""
    recordings = [
        recording("random", inertia=inertia_estimate([0.1, 0, 0])),
        recording("random", inertia=inertia_estimate([-0.3, 0, 0])),
        recording("periodic", inertia=inertia_estimate([0, 0.2, 0])),
        recording("periodic", inertia=inertia_estimate([0, 0.4, 0])),
    ]
    result = score(estimate(recordings), TRUTH)
    assert result["random"]["Ixx"]["mean"] == pytest.approx(0.1)
    assert result["random"]["Ixx"]["std"] == pytest.approx(0.4 / np.sqrt(2))
    assert result["random"]["Ixx"]["percent"] == pytest.approx(10 / 2.318)
    assert result["random"]["Ixx"]["std_percent"] == pytest.approx(40 / np.sqrt(2) / 2.318)
    assert result["periodic"]["Iyy"]["mean"] == pytest.approx(0.3)
    assert result["all"]["Ixx"]["mean"] == pytest.approx(0.05)
    assert result["all"]["Iyy"]["mean"] == pytest.approx(0.15)
    assert result["all"]["Iyy"]["std"] == pytest.approx(np.std([0, 0, 0.2, 0.4], ddof=1))


def test_inertia_takes_as_many_random_trials_as_periodic_ones():
    """The paper: six random trials for the grasps, three of them and three periodic ones for the inertia."""
    random = [
        recording("random", inertia=inertia_estimate([e, 0, 0])) for e in (0.1, 0.2, 0.3, 0.5, 0.5, 0.5)
    ]
    periodic = [recording("periodic", inertia=inertia_estimate([0, 0, 0])) for _ in range(3)]
    result = score(estimate([*random, *periodic]), TRUTH)
    assert result["random"]["Ixx"]["mean"] == pytest.approx(0.2)
    assert result["all"]["Ixx"]["mean"] == pytest.approx(0.1)
    assert score(estimate(random), TRUTH)["all"]["Ixx"]["mean"] == pytest.approx(0.35)


def test_what_is_missing_is_null():
    lonely = [recording("random", grasp_estimate(), inertia_estimate([0.1, 0, 0]))]
    nothing = replace(estimate(lonely), mass=None, p_1c=None)
    result = json.loads(json.dumps(score(nothing, TRUTH), allow_nan=False))
    assert result["R12_deg"]["std"] is None
    assert result["random"]["Ixx"]["mean"] == pytest.approx(0.1)
    assert result["random"]["Ixx"]["std"] is None
    assert result["periodic"]["Izz"] == {"mean": None, "std": None, "percent": None, "std_percent": None}
    assert (result["m_kg"], result["m_percent"], result["p1c_m"], result["p1c_percent"]) == (None,) * 4


def seen_through(theta_x_zero):
    """Grasps and centre of mass of a payload whose robots' last gimbal axes read too much, from poses as read."""
    T = [TRUTH.T(1, i) for i in (1, 2, 3)]
    world = [Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix() @ t[:3, :3] for t in T]
    angles = [Rotation.from_matrix(R).as_euler("ZYX") for R in world]
    read = [
        Rotation.from_euler("ZYX", a + np.array([0, 0, z])).as_matrix()
        for a, z in zip(angles, theta_x_zero, strict=True)
    ]
    to_first = read[0].T @ world[0]
    p = np.array([to_first @ t[:3, 3] for t in T])
    R = np.array([read[0].T @ r for r in read])
    return GraspEstimate(
        R, p, np.zeros((12, 12)), *(np.zeros((3, 3)),) * 2, *(np.ones(3),) * 2
    ), to_first @ TRUTH.p_1c


def built(zeros, ratio=0.0):
    return [AsBuilt(theta_zero_rad=np.array([0.0, 0.0, z]), stiffness_ratio=np.full(3, ratio)) for z in zeros]


def test_errors_vanish_in_the_frames_of_the_encoders():
    zeros = [0.02, -0.01, 0.0]
    grasps, p_1c = seen_through(zeros)
    result = score(estimate([recording("random", grasps)], p_1c=p_1c), TRUTH, built(zeros))
    seen = result["encoder_frames"]
    assert set(seen) == {k for k in result if k[0] in "Rp" and k not in ("random", "periodic")}
    for pair in ("12", "23", "31"):
        assert seen[f"R{pair}_deg"]["mean"] == pytest.approx(0, abs=1e-9)
        assert seen[f"p{pair}_m"]["mean"] == pytest.approx(0, abs=1e-12)
    assert seen["p1c_m"] == pytest.approx(0, abs=1e-12)
    # {1} is turned about x by 0.02: a point at distance d from that axis moves by 2 d sin(0.01).
    assert result["p1c_m"] == pytest.approx(2 * np.sin(0.01) * np.hypot(*TRUTH.p_1c[1:]))
    assert result["R12_deg"]["mean"] > 0.5
    assert "encoder_frames" not in score(estimate([]), TRUTH)


def test_fit_is_one_number_whose_share_of_the_spring_scale_is_told():
    """Everything as the encoders have it, masses over 1.01, the mass 0.1 % more."""
    zeros = [0.02, -0.01, 0.0]
    grasps, p_1c = seen_through(zeros)
    turn = Rotation.from_rotvec([-0.02, 0, 0]).as_matrix()
    mass = 1.001 * TRUTH.mass / 1.01
    about_1 = turn @ TRUTH.inertia @ turn.T / 1.01 + mass * (p_1c @ p_1c * np.eye(3) - np.outer(p_1c, p_1c))
    parameters = np.concatenate([[mass], mass * p_1c, about_1[np.triu_indices(3)]])
    found = CalibratedPayload("a", grasps, parameters, np.zeros((22, 22)), np.zeros(22))
    result = json.loads(json.dumps(score_fit(found, TRUTH, built(zeros, 0.01)), allow_nan=False))
    assert result["encoder_frames"]["R31_deg"] == {"mean": pytest.approx(0, abs=1e-9), "std": None}
    assert result["encoder_frames"]["p1c_m"] == pytest.approx(0, abs=1e-12)
    assert result["m_percent"] == pytest.approx(100 * (1 - 1.001 / 1.01))
    assert result["all"]["Iyy"]["percent"] == pytest.approx(100 * (1 - 1 / 1.01))
    assert result["all"]["Iyy"]["std"] is None
    scale = result["spring_scale"]
    assert scale["percent"] == pytest.approx(100 * (1 / 1.01 - 1))
    assert scale["m_percent"] == pytest.approx(0.1)
    assert scale["Ixx_percent"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1.0, 179.999])
def test_rotation_error_is_the_angle_between(angle):
    R = Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix()
    turned = R @ Rotation.from_rotvec(np.deg2rad(angle) * np.array([0.6, 0, 0.8])).as_matrix()
    assert rotation_error_deg(R, turned) == pytest.approx(angle, abs=1e-9)
