"""Payloads carried by their estimates: a door that a person folds, and a rigid frame with inertia in the feed-forward.

Arms without stiffness carry the two bodies of payload `hinged`. A person holds one of them still and folds the other.
The forces of both hands show what the estimate of two bodies is worth. Then stiff arms move a rigid payload along fast
commands, with and without the forces that its estimated inertia needs.

python scenarios/hinged_payload.py
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import mocobot
from mocobot import GroundTruth, build_team, run_trial
from mocobot.guiding import (
    FLOAT_GAINS,
    FloatArms,
    FloatTwoBodies,
    Grip,
    GuidingHand,
    HandLog,
    Move,
    Payload,
)
from mocobot.robots import forward_kinematics, omnid_design
from mocobot.trajectories import RATE_HZ, Trajectory, sphere_motion

BEGIN_S, FOLD_RAD = 3.0, 0.2
STILL = Grip(20000.0, 1500.0, 2000.0, 100.0)
# A hand that pulls at the edge of the door, and does not turn it.
PULL = Grip(2000.0, 150.0, 0.0, 0.0)
EDGE_1, HELD_1 = (1.105, 0.1, 0.079), (0.2, 0.05, 0.079)


def main() -> None:
    """Print both comparisons."""
    fold_the_door()
    follow_commands()


def fold_the_door() -> None:
    """Compare the hands' forces for three ways of carrying two bodies."""
    scene = build_team("hinged")
    truth = GroundTruth.of(scene)
    logs = [mocobot.simulate("hinged", trial) for trial in ("periodic", "static")]
    estimate = mocobot.estimate(logs, payload="hinged")
    rigid = Payload.of_truth(truth)
    print(f"hand forces to fold a door of {truth.mass_kg:.1f} kg by +-{FOLD_RAD:g} rad: one folds, one holds")
    print(
        "arms carry                              folds: rms   at the holds [N]   holds: at the holds [N, N m]"
    )
    for name, arms in (
        ("one rigid body (true, joint at zero)", FloatArms(rigid)),
        ("the forces measured at the start", FloatArms(None)),
        ("two bodies as estimated", FloatTwoBodies(estimate, scene.X_Wb)),
    ):
        folds, holds = _hands(scene, truth, arms)
        moving = folds.time >= BEGIN_S
        rms = np.sqrt(np.mean(np.sum(folds.force[moving] ** 2, axis=1)))
        at = [round((BEGIN_S + t) * RATE_HZ) for t in (3.4, 7.9)]
        numbers = [np.linalg.norm(x[at], axis=1).max() for x in (folds.force, holds.force, holds.moment)]
        print(f"{name:40s} {rms:9.2f} {numbers[0]:18.3f} {numbers[1]:19.3f} {numbers[2]:8.3f}")


def _hands(scene: mocobot.TeamScene, truth: GroundTruth, arms: FloatArms) -> tuple[HandLog, HandLog]:
    """Fold the door to both sides; return the logs of the hand that folds and of the one that holds."""
    joint = truth.joint
    assert joint is not None
    arm = np.array(EDGE_1) - joint.pivot_1

    def at(q: float) -> Move:
        by = Rotation.from_rotvec(q * joint.axis_1).apply(arm) - arm
        return Move((by[0], by[1], by[2]), (0.0, 0.0, 0.0), 3.0 if q < 0 else 2.0, 1.5)

    folds = GuidingHand(EDGE_1, (at(FOLD_RAD), at(-FOLD_RAD), at(0.0)), BEGIN_S, PULL, second=True)
    holds = GuidingHand(HELD_1, (Move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0),), BEGIN_S, STILL)
    stay = np.tile(scene.wrist_home_b, (round(folds.duration_s * RATE_HZ) + 1, 1, 1))
    run_trial(scene, Trajectory("static", stay), FLOAT_GAINS, actors=[holds, folds, arms])
    return folds.log(), holds.log()


class InertialForces:
    """Actor that sets the forces which a rigid payload needs on its commanded motion.

    Args:
        forces: of every wrist in its {b} [N], one row per sample, shape (Q, N, 3).
    """

    def __init__(self, forces: np.ndarray) -> None:
        self._spline = CubicSpline(np.arange(len(forces)) / RATE_HZ, forces)

    def start(self, stage) -> None:
        """Prepare for a trial."""
        self._stage = stage

    def act(self, tick: int) -> None:
        """Set the forces of this tick."""
        self._stage.controller.feed_forward = self._spline(tick / self._stage.rate_hz)


def follow_commands() -> None:
    """Compare the tracking of fast commands with weight alone, and with inertia, in the feed-forward."""
    scene = build_team("a")
    logs = [mocobot.simulate("a", trial) for trial in ("random", "periodic", "static")]
    estimate = mocobot.estimate(logs)
    motion = sphere_motion(scene.wrist_home_b, scene.X_1i, duration_s=20.0)
    # Bases are parked, so wrists in the world tell the commanded pose of the payload.
    wrists = np.stack([scene.X_Wb[i].apply(motion.ref_b[:, i]) for i in range(scene.robots)], axis=1)
    print("\ncommanded motion of rigid payload a, wrists off by (rms):")
    for name, inertial in (("weight", 0.0), ("weight and inertia", 1.0)):
        forces = rigid_forces(estimate, wrists, inertial)
        in_base = np.einsum("nji,qnj->qni", scene.X_Wb.rotation.as_matrix(), forces)
        log = run_trial(scene, motion, actors=[InertialForces(in_base)], feed_forward=in_base[0])
        wrist = forward_kinematics(log.phi, omnid_design())
        off = np.sqrt(np.mean(np.sum((wrist - motion.ref_b) ** 2, axis=-1)))
        print(f"  {name:20s} {1e3 * off:.2f} mm")


def rigid_forces(estimate: mocobot.Estimate, wrists_W: np.ndarray, inertial: float) -> np.ndarray:
    """Forces of least norm that move an estimated payload with its wrists [N], shape (Q, N, 3), in the world.

    Args:
        estimate: of the payload.
        wrists_W: commanded wrists in the world [m], shape (Q, N, 3).
        inertial: share of the inertial forces, 0 or 1.
    """
    grasps, mass, com, inertia = estimate.grasps, estimate.mass, estimate.p_1c, estimate.inertia
    arms = grasps.p_1i - grasps.p_1i.mean(axis=0)
    turns = [Rotation.align_vectors(p - p.mean(axis=0), arms)[0].as_matrix() for p in wrists_W]
    R = np.array(turns)
    centre = wrists_W.mean(axis=1) + R @ (com - grasps.p_1i.mean(axis=0))
    time = np.arange(len(R)) / RATE_HZ
    acceleration = inertial * CubicSpline(time, centre)(time, 2)
    R_dot = CubicSpline(time, R)(time, 1)
    spin = R_dot @ np.swapaxes(R, 1, 2)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    momentum = np.einsum("qij,jk,qlk,ql->qi", R, inertia.inertia, R, omega)
    moment = inertial * CubicSpline(time, momentum)(time, 1)
    force = mass.mass * (acceleration + np.array([0.0, 0.0, 9.81]))
    out = np.empty_like(wrists_W)
    for k, (p, c) in enumerate(zip(wrists_W, centre, strict=True)):
        rows = np.vstack([np.hstack([np.eye(3)] * len(p)), np.hstack([_skew(arm) for arm in p - c])])
        out[k] = np.linalg.lstsq(rows, np.append(force[k], moment[k]), rcond=None)[0].reshape(-1, 3)
    return out


def _skew(v: Sequence[float]) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


if __name__ == "__main__":
    main()
