"""The arm: what its owner's model says, how a healthy one differs from it, how it moves, and what is logged of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from discrepancy.joints.model import SerialModel, load_model
from mocobot_logs.joints.joint_log import Drive, JointLog

Torques = Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
"""Torques that act on the joints besides [N m], from positions, velocities, drive torques and time."""

MODEL = Path(__file__).resolve().parents[2] / "models" / "panda" / "panda.xml"
DRY_NM = np.array([0.9, 1.1, 0.8, 0.9, 0.35, 0.3, 0.3])
VISCOUS = np.array([0.8, 0.9, 0.6, 0.7, 0.25, 0.2, 0.2])
ROTOR_KGM2 = np.array([0.6, 0.6, 0.45, 0.45, 0.2, 0.2, 0.15])
"""Of the model: a lab that has identified its arm knows them. Plausible for such gears, of no certain arm."""
CENTRE = np.array([0.0, -0.3, 0.0, -1.7, 0.0, 1.8, 0.4])
HALF_WAY = np.array([1.1, 0.8, 1.0, 0.8, 1.2, 1.0, 1.2])
"""Middle and half of the motion [rad]; inside the ranges by 0.3 rad."""
TORQUE_NOISE_NM = np.array([0.04, 0.05, 0.03, 0.03, 0.012, 0.01, 0.01])
STEP_RAD = 2.0 * np.pi / 2**17
RATE_HZ, TIMESTEP_S, SECONDS = 500.0, 5e-4, 60.0
BANDWIDTH_PER_S = 15.0
"""Of the controller, critically damped."""
BEND = "bend"
"""How names of joints begin that no motor moves."""

INERTIA_SHARE, JOINT_SHARE, SCALE_SHARE = 0.1, 0.03, 0.02
ZERO_RAD, LENGTH_M, DELAY_S, LEVEL_RAD = 2e-3, 1e-3, 5e-4, 5e-3
"""A healthy arm: standard deviations of what its model has wrong, as ``docs/diagnosis/method.md`` says."""


@dataclass(frozen=True)
class Healthy:
    """What no model knows of one healthy arm.

    Attributes:
        spec: of the true arm.
        zero: added to its positions where they are read [rad], shape (7,).
        scale: of its torques where they are read, shape (7,).
        delay_s: by which they are read late, shape (7,).
    """

    spec: mujoco.MjSpec
    zero: np.ndarray
    scale: np.ndarray
    delay_s: np.ndarray


@dataclass(frozen=True)
class Motion:
    """What really happened, at the log's rate.

    Attributes:
        time: shape (n,).
        q, dq, ddq: positions, velocities and accelerations of the joints (of a joint that bends, on the motor's side),
            shape (n, 7).
        torque: of the drives, shape (n, 7).
    """

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    torque: np.ndarray


def model_spec() -> mujoco.MjSpec:
    """The owner's model, for changes before it is compiled."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    for k, joint in enumerate(spec.joints):
        joint.frictionloss, joint.armature = DRY_NM[k], ROTOR_KGM2[k]
        joint.damping = [VISCOUS[k], 0.0, 0.0]
        joint.limited = joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    return spec


def nominal(folder: Path) -> SerialModel:
    """The owner's model as the diagnosis reads it, from a file in a folder."""
    path = folder / "arm.xml"
    if not path.is_file():
        spec = model_spec()
        spec.compile()
        path.write_text(spec.to_xml(), encoding="utf-8")
    return load_model(path)


def healthy(rng: np.random.Generator, times: float = 1.0) -> Healthy:
    """An arm whose numbers are off within their tolerances, or so many times as far."""
    spec = model_spec()
    for body in spec.bodies[1:]:
        if body.name == "link0":
            continue
        share = times * INERTIA_SHARE
        body.mass *= max(1.0 + share * rng.standard_normal(), 0.3)
        # Turned with its frame, an inertia stays one; its size changes as the mass' would.
        body.fullinertia = np.asarray(body.fullinertia) * max(1.0 + share * rng.standard_normal(), 0.3)
        body.ipos = np.asarray(body.ipos) * (1.0 + share * rng.standard_normal(3))
        if body.name != "link1":
            body.pos = np.asarray(body.pos) + times * LENGTH_M * rng.standard_normal(3)
    tilt = times * LEVEL_RAD * rng.standard_normal(2)
    spec.option.gravity = 9.81 * np.array([tilt[0], tilt[1], -np.sqrt(1.0 - tilt @ tilt)])
    for joint in spec.joints:
        share = 1.0 + times * JOINT_SHARE * rng.standard_normal(3)
        joint.armature *= share[0]
        joint.frictionloss *= share[1]
        joint.damping = np.asarray(joint.damping) * share[2]
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    zero, scale, delay = (size * times * rng.standard_normal(7) for size in (ZERO_RAD, SCALE_SHARE, DELAY_S))
    return Healthy(spec, zero, 1.0 + scale, delay)


def moved(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    besides: Sequence[Torques] = (),
    force: Callable[[float], np.ndarray] | None = None,
) -> Motion:
    """Let an arm follow sums of sines under a computed-torque controller.

    Args:
        spec: of the true arm.
        rng: of the motion.
        besides: what acts on its joints that MJCF does not say.
        force: on the centre of mass of the last link [N], in the world, by time; None for none.

    Raises:
        RuntimeError: it did not stay near its reference.
    """
    spec.option.timestep, spec.option.integrator = TIMESTEP_S, mujoco.mjtIntegrator.mjINT_EULER
    model = spec.compile()
    data, last = mujoco.MjData(model), model.nbody - 1
    motors = np.array([j for j in range(model.njnt) if not model.joint(j).name.startswith(BEND)])
    J = len(motors)
    f = 0.07 + np.sort(rng.uniform(0.0, 0.6, (5, J)), axis=0)
    size, phase = rng.uniform(0.5, 1.0, (5, J)) / f, rng.uniform(0.0, 2.0 * np.pi, (5, J))
    # From the middle of its way, at rest.
    span = np.linspace(0.0, SECONDS, 3000)
    way = (size * np.sin(2.0 * np.pi * f * span[:, None, None] + phase)).sum(axis=1)
    size *= HALF_WAY / np.abs(way).max(axis=0)
    w, every, steps = 2.0 * np.pi * f, round(1.0 / RATE_HZ / TIMESTEP_S), round(SECONDS / TIMESTEP_S)
    time = TIMESTEP_S * np.arange(steps)
    start = np.minimum(time / 2.0, 1.0)[:, None]
    ease = start**3 * (10.0 - 15.0 * start + 6.0 * start**2)
    ease1 = 30.0 * (start * (1.0 - start)) ** 2 / 2.0
    ease2 = (60.0 * start - 180.0 * start**2 + 120.0 * start**3) / 4.0
    x, x1, x2 = np.zeros((3, steps, J))
    for rate, much, shift in zip(w, size, phase, strict=True):
        s, c = np.sin(rate * time[:, None] + shift), np.cos(rate * time[:, None] + shift)
        x, x1, x2 = x + much * s, x1 + much * rate * c, x2 - much * rate**2 * s
    r, r1 = CENTRE + ease * x, ease * x1 + ease1 * x
    ahead = ease * x2 + 2.0 * ease1 * x1 + ease2 * x + 2.0 * BANDWIDTH_PER_S * r1 + BANDWIDTH_PER_S**2 * r
    data.qpos[motors] = r[0]
    log, inertia = np.empty((4, steps // every, J)), np.zeros((model.nv, model.nv))
    all_move, square = model.nv == J, np.ix_(motors, motors)
    for k in range(steps):
        mujoco.mj_step1(model, data)
        if k % 20 == 0:
            mujoco.mj_fullM(model, data, inertia)
            rigid = inertia[square]
        q, v, bias = data.qpos, data.qvel, data.qfrc_bias
        if not all_move:
            q, v, bias = q[motors], v[motors], bias[motors]
        wanted = ahead[k] - 2.0 * BANDWIDTH_PER_S * v - BANDWIDTH_PER_S**2 * q
        torque = rigid @ wanted + bias
        applied = torque
        for own in besides:
            applied = applied + own(q, v, torque, data.time)
        data.qfrc_applied[motors] = applied
        if force is not None:
            data.xfrc_applied[last, :3] = force(data.time)
        here = k // every
        if k % every == 0:
            log[0, here], log[1, here], log[3, here] = q, v, torque
        mujoco.mj_step2(model, data)
        if k % every == 0:
            log[2, here] = data.qacc[motors]
    if not np.isfinite(log).all() or np.abs(log[0] - CENTRE).max() > 2.0:
        raise RuntimeError("the arm did not stay near its reference")
    return Motion(np.arange(len(log[0])) / RATE_HZ, *log)


def late(time: np.ndarray, torque: np.ndarray, delay_s: np.ndarray) -> np.ndarray:
    """Torques as they are read so much later, shape (n, J)."""
    return np.column_stack(
        [
            np.interp(time - d, time, torque[:, j])
            for j, d in enumerate(np.broadcast_to(delay_s, torque.shape[1]))
        ]
    )


def logged(name: str, time: np.ndarray, q: np.ndarray, torque: np.ndarray, rng: np.random.Generator | None,
           noise: tuple[float, float] | None = None) -> JointLog:  # fmt: skip
    """The log of what sensors read; without their errors if there is no generator.

    Args:
        name: of the log.
        time: shape (n,).
        q, torque: as they are read, shape (n, 7).
        rng: of the errors.
        noise: of positions [rad] and torques [N m] in place of the arm's own.
    """
    J = q.shape[1]
    if rng is not None:
        q = q + noise[0] * rng.standard_normal(q.shape) if noise else q
        q = np.round(q / STEP_RAD) * STEP_RAD
        torque = torque + (noise[1] if noise else TORQUE_NOISE_NM) * rng.standard_normal(torque.shape)
    unknown = np.full(J, np.nan)
    drive = Drive(
        np.full(J, 100.0), np.eye(J) / 100.0, np.ones(J), np.zeros(J, dtype=bool), "none", unknown, unknown, "torque",
        np.full(J, np.inf),
    )  # fmt: skip
    names = tuple(f"joint{k}" for k in range(1, J + 1))
    step = np.full(J, STEP_RAD)
    return JointLog(
        name, time, RATE_HZ, q, torque, None, None, names, drive, step, np.ones(len(q), dtype=bool), RATE_HZ
    )
