"""Torques and slopes of a machine with causes in it, against MuJoCo and against differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.payload import AXES, ball_inertia
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rows.applied import Applied

from discrepancy.candidate import Candidate
from discrepancy.joints.mechanics.motion import Motion
from discrepancy.joints.mechanics.regressor import inertial_parameters, rigid_torque
from discrepancy.least_squares.problem import Problem
from discrepancy.least_squares.renewed import renewed
from serial_made import nominal, simulated, spec

Values = list[tuple[Candidate, np.ndarray]]
CENTRE, MASS, MOMENTS = (0.08, -0.05, 0.12), 1.4, (2e-3, 3e-3, 4e-3, 5e-4, -3e-4, 2e-4)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> SerialRig:
    """Logs of an arm as its model says."""
    return SerialRig.of(
        nominal(tmp_path_factory.mktemp("arm")), [simulated(spec().compile(), 4, seconds=8.0)]
    )


def found(rig: SerialRig, cause: str, joint: int | None) -> Candidate:
    return next(c for c in rig.candidates() if (c.cause, c.joint) == (cause, joint))


def payload(rig: SerialRig) -> tuple[Candidate, np.ndarray]:
    """A payload with the inertia of MOMENTS about its centre, which the cause counts from a ball's."""
    candidate = found(rig, "payload", 4).in_shape(dict(zip(AXES, CENTRE, strict=True)))
    ball = ball_inertia(MASS)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return candidate, np.array([MASS, *(np.array(MOMENTS) - ball)])


def everywhere_off(rig: SerialRig, spread: float) -> Values:
    """All that has a tolerance off by several, a payload, a spring and friction that grows with the load."""
    rng = np.random.default_rng(8)
    off = [c for c in rig.candidates() if all(p.tolerance > 0 for p in c.parameters) and c.cause != "payload"]
    values = [(c, spread * rng.standard_normal(len(c.parameters)) * c.units) for c in off]
    more = [(found(rig, "spring", 3), np.array([3.0])), (found(rig, "load_friction", 2), np.array([0.1]))]
    return [*values, payload(rig), *more]


def test_a_payload_is_a_part_of_its_link(rig: SerialRig) -> None:
    """With masses, centres, seats and zeros off besides: torques as of such a model, by MuJoCo."""
    signals = rig.parts[0].signals
    zeros, seat, com, share = (
        np.array([0.02, -0.03, 0.04, 0.1]),
        [0.01, -0.02, 0.03],
        [0.02, 0.01, -0.03],
        0.3,
    )
    active = [(found(rig, "joint_zero", j + 1), zeros[[j]]) for j in range(1, 4)]
    active += [
        (found(rig, "link_length", 4), np.array(seat)),
        (found(rig, "link_com", 4), np.array(com)),
        (found(rig, "link_mass", 4), np.array([share * 0.8])),
        payload(rig),
    ]
    real = spec()
    hand = real.body("hand")
    hand.mass *= 1.0 + share
    hand.fullinertia = np.asarray(hand.fullinertia) * (1.0 + share)
    hand.ipos, hand.pos = np.asarray(hand.ipos) + com, np.asarray(hand.pos) + seat
    load = hand.add_body()
    load.mass, load.ipos, load.fullinertia, load.explicitinertial = MASS, list(CENTRE), list(MOMENTS), True
    model = real.compile()
    data = mujoco.MjData(model)
    asked = Applied.of(signals, active).laden.inverse
    for k in range(0, len(signals.time), 97):
        data.qpos[:] = signals.q[k] + np.array([0.0, *zeros[1:]])
        data.qvel[:], data.qacc[:] = signals.dq[k], signals.ddq[k]
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(asked[k], data.qfrc_inverse, atol=1e-9)


@pytest.mark.parametrize("spread", [1.0, 4.0])
def test_slopes_are_those_of_the_residual(rig: SerialRig, spread: float) -> None:
    """Of everything that has slopes of its own, by central differences of exact residuals."""
    active = everywhere_off(rig, spread)
    slopes, kinds = rig.slopes(active), set()
    for k, ((candidate, values), columns) in enumerate(zip(active, slopes, strict=True)):
        if columns is None:
            continue
        kinds.add(candidate.cause)
        for j, unit in enumerate(candidate.units):
            ends = []
            for sign in (1.0, -1.0):
                moved = np.array(values)
                moved[j] += sign * 0.01 * unit
                ends.append(
                    rig.residual(np.zeros(0), [], [*active[:k], (candidate, moved), *active[k + 1 :]])
                )
            told = np.concatenate([(less - more).ravel() for more, less in zip(*ends, strict=True)]) / (
                0.02 * unit
            )
            made = np.concatenate([block[..., j].ravel() for block in columns])
            assert unit * np.linalg.norm(told - made) < 0.02 + 2e-3 * unit * np.linalg.norm(told), (
                candidate.label
            )
    assert kinds >= {
        "joint_zero",
        "link_mass",
        "link_com",
        "link_inertia",
        "link_length",
        "gravity_direction",
    }
    assert kinds >= {"payload", "torque_scale", "load_friction"}


def test_slopes_of_the_model_are_its_columns(rig: SerialRig) -> None:
    active = [(c, np.zeros(len(v))) for c, v in everywhere_off(rig, 1.0)]
    for (candidate, _), columns in zip(active, rig.slopes(active), strict=True):
        for block, own in zip(columns or [], rig.columns(candidate), strict=False):
            np.testing.assert_allclose(block, own, atol=1e-5 * np.abs(own).max(initial=1.0))


def test_drives_that_tell_no_torque_keep_the_models_slopes(rig: SerialRig) -> None:
    assert rig.slopes_vary
    assert not replace(rig, motors=(None,)).slopes_vary


def test_torques_are_straight_in_a_mass_down_to_below_nought(rig: SerialRig) -> None:
    signals, b = rig.parts[0].signals, 2

    def torque(mass: float) -> np.ndarray:
        tree = replace(
            signals.tree, mass=np.where(np.arange(len(signals.tree.mass)) == b, mass, signals.tree.mass)
        )
        return rigid_torque(Motion.of(tree, signals.q, signals.dq, signals.ddq))

    np.testing.assert_allclose(torque(-1.0) - torque(1.0), torque(1.0) - torque(3.0), atol=1e-9)


def test_many_columns_at_once_are_those_one_by_one(rig: SerialRig) -> None:
    candidates = rig.candidates()
    problem = Problem.of(rig.rows(candidates), candidates)
    rng = np.random.default_rng(3)
    changed = {
        i: [x + 0.1 * np.abs(x).max() * rng.standard_normal(x.shape) for x in rig.columns(candidates[i])]
        for i in (0, 3, len(candidates) - 1)
    }
    one_by_one = problem
    for i, columns in changed.items():
        one_by_one = one_by_one.with_columns(i, candidates[i], columns)
    at_once = renewed(problem, changed)
    np.testing.assert_allclose(
        at_once.grams, one_by_one.grams, rtol=1e-9, atol=1e-9 * np.abs(problem.grams).max()
    )
    for t in problem.trials:
        np.testing.assert_allclose(
            at_once.raw_columns(t, slice(None)), one_by_one.raw_columns(t, slice(None)), atol=1e-9
        )
    assert renewed(problem, {}) is problem


@pytest.mark.slow
def test_a_payload_and_a_zero_are_two_causes(tmp_path: Path) -> None:
    """Links that scatter explain most of it; what a payload's weight makes of a zero no straight column has."""
    real = spec()
    load = real.body("hand").add_body()
    load.mass, load.ipos, load.fullinertia, load.explicitinertial = MASS, list(CENTRE), list(MOMENTS), True
    off = np.array([0.0, 0.0, 0.04, 0.0])
    log = simulated(real.compile(), 6, read=lambda q, torque: (q - off, torque))
    causes = diagnose_serial(nominal(tmp_path), [log], laws="never", closed_loop=False).diagnosis.causes
    assert {(one.candidate.cause, one.candidate.joint) for one in causes} == {
        ("payload", 4),
        ("joint_zero", 3),
    }
    for one in causes:
        truth = {"payload": MASS, "joint_zero": 0.04}[one.candidate.cause]
        assert abs(one.values[0] - truth) < 3.5 * np.sqrt(one.covariance[0, 0]), one.candidate.label


def test_a_payload_nearer_by_has_the_same_first_moment_and_more_inertia_of_its_own(rig: SerialRig) -> None:
    """Beside the same moments about the frame: what is told too far out, with less than none there, can be again."""
    candidate, tree = found(rig, "payload", 4), rig.tree
    centre = np.array([0.1, -0.11, 0.05])
    away = centre / np.linalg.norm(centre)
    second = 5e-4 * np.eye(3) - 3e-3 * np.outer(away, away)
    own = np.trace(second) * np.eye(3) - second
    wanted, shares = inertial_parameters(1.0, centre, own), []
    far = candidate.in_shape(dict(zip(AXES, map(float, centre), strict=True)))
    for nearer in (far, *rig.closer(far)):
        at = np.array([nearer.shape[axis] for axis in AXES])
        share = float(at @ centre / (centre @ centre))
        np.testing.assert_allclose(at, share * centre)
        more = own + (1.0 - share) * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        np.testing.assert_allclose(inertial_parameters(1.0 / share, at, more)[1:], wanted[1:], atol=1e-15)
        six = (more - ball_inertia(1.0 / share))[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        can_be = CAUSES["payload"].possible(tree, 3, np.array([1.0 / share, *six]), np.full(7, 1e-5))
        shares.append((share, can_be))
    assert shares[0] == (pytest.approx(1.0), False)
    assert all(less < more for (less, _), (more, _) in zip(shares[1:], shares, strict=False))
    assert all(can_be for _, can_be in shares[1:])
