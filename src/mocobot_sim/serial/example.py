"""A six-axis arm with one hidden fault, simulated in MuJoCo: its model, a log of today and a log of last week."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco
import numpy as np

from estimator.arrays import Array
from estimator.files import make_folder, write_text
from mocobot_sim.scene.models import models_dir

MODEL, TODAY, LAST_WEEK, ANSWER = "arm.xml", "today.csv", "last_week.csv", "answer.txt"
"""Files of an example."""
FAULTY, FAULT_NM = "elbow", 4.0
"""Joint with the fault, and the dry friction that it has more than in the model [N m]."""
SECONDS, RATE_HZ, TIMESTEP_S = 30.0, 200.0, 1e-3
CENTRE_RAD = np.array([0.0, 0.3, 1.2, 0.3, 0.4, 0.0])
HALF_WAY_RAD = np.array([1.2, 0.6, 0.9, 1.1, 1.2, 1.4])
"""Middle and half of the motion. Chosen: the arm stays above the floor and clear of itself."""
SLOWEST_HZ, FASTEST_HZ, SINES, START_S = 0.07, 0.45, 5, 2.0
"""Frequencies and number of the sines of a joint's motion, and the time in which they swell. Chosen."""
BANDWIDTH_PER_S = 20.0
"""Bandwidth of every joint's controller, critically damped. Chosen: small errors at these speeds."""
SHARE, ZERO_RAD = 0.03, 5e-4
"""Standard deviations of masses, friction and encoder zeros of a healthy arm around its model. Chosen: a good model."""
STEP_RAD, NOISE_RAD_S = 2.0 * np.pi / 2**15, 2e-3
NOISE_NM = np.array([0.15, 0.15, 0.1, 0.05, 0.05, 0.05])
"""Step of the encoders; noise of velocities and torques. Chosen: plausible for an arm of 20 kg."""
WEEK_S, TODAY_S = 604_800.0, 1_767_600_000.0
"""One week, and the time at which the log of today begins (Unix time)."""


def write_example(folder: Path | str) -> None:
    """Write model, logs and answer into a folder, which is created if missing; the same bits each time on one machine.

    Raises:
        InputError: a file cannot be written.
    """
    folder, source = make_folder(Path(folder)), models_dir() / "six_axis" / MODEL
    shutil.copyfile(source, folder / MODEL)
    model, rubs = mujoco.MjModel.from_xml_path(str(source)), []
    for name, more, start, seed in ((LAST_WEEK, 0.0, TODAY_S - WEEK_S, 1), (TODAY, FAULT_NM, TODAY_S, 2)):
        arm, zero = _true_arm(source, more)
        rubs.append(f"{arm.joint(FAULTY).frictionloss[0]:.2f} N m in {name}")
        write_text(folder / name, _log(model, arm, zero, start, seed))
    write_text(
        folder / ANSWER,
        f"Dry (Coulomb) friction of the joint {FAULTY} is {' and '.join(rubs)}; the model has "
        f"{model.joint(FAULTY).frictionloss[0]:.2f} N m.\nAll else is the same in both logs. Masses and friction of "
        f"the arm differ from the model by about {100.0 * SHARE:.0f} %, as in any healthy arm.\n",
    )


def _true_arm(source: Path, friction_Nm: float) -> tuple[mujoco.MjModel, Array]:
    """Return an arm that differs from its model, with more dry friction in one joint, and its encoders' zeros [rad]."""
    rng = np.random.default_rng(0)
    spec = mujoco.MjSpec.from_file(str(source))
    for body in spec.bodies[1:]:
        share = 1.0 + SHARE * rng.standard_normal()
        body.mass, body.inertia = body.mass * share, np.asarray(body.inertia) * share
    for joint in spec.joints:
        joint.frictionloss *= 1.0 + SHARE * rng.standard_normal()
        joint.frictionloss += friction_Nm if joint.name == FAULTY else 0.0
        # Stiffer than MuJoCo's own values, so that a joint at rest does not creep.
        joint.solref_friction, joint.solimp_friction = [2.0 * TIMESTEP_S, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    spec.option.timestep = TIMESTEP_S
    return spec.compile(), ZERO_RAD * rng.standard_normal(len(spec.joints))


def _motion(joints: int) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations to follow, shape (steps, J) each: sums of sines that swell."""
    rng = np.random.default_rng(0)
    time = TIMESTEP_S * np.arange(round(SECONDS / TIMESTEP_S))[:, None, None]
    hz = np.sort(rng.uniform(SLOWEST_HZ, FASTEST_HZ, (SINES, joints)), axis=0)
    way = (np.sin(2.0 * np.pi * (hz * time + rng.uniform(0.0, 1.0, hz.shape))) / hz).sum(axis=1)
    share = np.minimum(time[:, 0] / START_S, 1.0)
    way *= share**3 * (10.0 - 15.0 * share + 6.0 * share**2) * HALF_WAY_RAD / np.abs(way).max(axis=0)
    speed = np.gradient(way, TIMESTEP_S, axis=0)
    return CENTRE_RAD + way, speed, np.gradient(speed, TIMESTEP_S, axis=0)


def _log(model: mujoco.MjModel, arm: mujoco.MjModel, zero: Array, start_s: float, seed: int) -> str:
    """Simulate the true arm under a controller that knows the model, and return what a logger writes as CSV."""
    rng = np.random.default_rng(seed)
    data, known, J = mujoco.MjData(arm), mujoco.MjData(model), model.nv
    motion = _motion(J)
    inertia = np.zeros((J, J))
    known.qpos[:] = data.qpos[:] = motion[0][0]
    mujoco.mj_forward(model, known)
    mujoco.mj_fullM(model, known, inertia)
    gain = BANDWIDTH_PER_S * np.diag(inertia)
    every, rows = round(1.0 / RATE_HZ / TIMESTEP_S), []
    for k, (q, dq, ddq) in enumerate(zip(*motion, strict=True)):
        known.qpos[:], known.qvel[:], known.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, known)
        torque = known.qfrc_inverse + gain * (BANDWIDTH_PER_S * (q - data.qpos) + 2.0 * (dq - data.qvel))
        if k % every == 0:
            rows.append((data.qpos + zero, data.qvel.copy(), torque))
        data.qfrc_applied[:] = torque
        mujoco.mj_step(arm, data)
    read = np.array(rows)  # shape (n, 3, J)
    noise = np.array([np.zeros(J), np.full(J, NOISE_RAD_S), NOISE_NM])
    read += noise * rng.standard_normal(read.shape)
    read[:, 0] = np.round(read[:, 0] / STEP_RAD) * STEP_RAD
    kinds = ("position", "velocity", "effort")
    head = [f"/joint_states/{model.joint(j).name}/{kind}" for kind in kinds for j in range(J)]
    lines = [",".join(["__time", *head])]
    for k, row in enumerate(read.reshape(len(read), -1)):
        lines.append(",".join([f"{start_s + k / RATE_HZ:.3f}", *(f"{x:.9g}" for x in row)]))
    return "\n".join(lines) + "\n"
