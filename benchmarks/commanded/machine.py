"""The true machine, stepped by MuJoCo: commands that arrive late, drives, friction of any law, encoders."""

from __future__ import annotations

from dataclasses import dataclass

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from commanded.bodies import STEP_S
from commanded.rubbing import Law

SETTLE_S = 3.0
"""Time at rest before the log begins."""
Array = np.ndarray
FIRMWARE_S = 1e-3
"""Period of a servo's own loop."""


@dataclass
class Machine:
    """A machine as the simulator runs it.

    Attributes:
        model: MuJoCo's model; its actuators are, per joint, a drive, and for servos the back-EMF after all drives.
        joints: names of the logged joints.
        law: friction.
        delay_s: from the stamp of a command to its effect.
        servo: whether a firmware at 1 kHz holds the drives' torques, from an encoder of ``counts`` a turn; else the
            drives are continuous.
        kp: position gain [N m/rad], shape (J,).
        most: largest torque of the position loop [N m], shape (J,).
        counts: of the encoders in a turn.
    """

    model: mujoco.MjModel
    joints: tuple[str, ...]
    law: Law
    delay_s: float
    servo: bool
    kp: Array
    most: Array
    counts: int


def addresses(m: mujoco.MjModel, joints: tuple[str, ...]) -> tuple[Array, Array, Array]:
    """Places of joints in positions and speeds, and the matrix (J, nq) that adds a joint's play to its position.

    Logged positions are those behind the play. A servo's loop is closed there, too; a leg's at the motor.
    """
    own = np.array([m.joint(name).id for name in joints])
    adds = np.zeros((len(own), m.nq))
    adds[np.arange(len(own)), m.jnt_qposadr[own]] = 1.0
    for j, name in enumerate(joints):
        play = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_JOINT, f"{name}_play")
        if play >= 0:
            adds[j, m.jnt_qposadr[play]] = 1.0
    return m.jnt_qposadr[own], m.jnt_dofadr[own], adds


@dataclass(frozen=True)
class Run:
    """What happened, at the stamps of the log.

    Attributes:
        q: positions behind a play, before the encoder rounds them [rad], shape (n, J).
        dq: speeds [rad/s], shape (n, J).
        torque: of the drives, back-EMF and all [N m], shape (n, J).
        outside: torque from outside, by the law's convention [N m], shape (n, J).
        state: MuJoCo's positions and speeds, shape (n, nq + nv).
    """

    q: Array
    dq: Array
    torque: Array
    outside: Array
    state: Array


def arriving(stamps: Array, commands: Array, delay_s: float | Array, edges: Array) -> Array:
    """Mean of the command in effect between ``edges`` [s], shape (len(edges) - 1, J).

    A command holds from its stamp plus the delay (one, or one a joint) to that of the next; the first one before, too.
    """
    gone = np.vstack(
        (np.zeros(commands.shape[1]), np.cumsum(commands[:-1] * np.diff(stamps)[:, None], axis=0))
    )
    out = np.empty((len(edges) - 1, commands.shape[1]))
    for j, late in enumerate(np.broadcast_to(delay_s, commands.shape[1])):
        sent = edges - late
        at = (np.searchsorted(stamps, sent, side="right") - 1).clip(0)
        out[:, j] = np.diff(gone[at, j] + commands[at, j] * (sent - stamps[at])) / np.diff(edges)
    return out


def late_at_servo(stamps: Array, delay_s: float) -> float:
    """Mean time from a command's stamp to the period of the firmware that uses it [s]."""
    return float(np.mean(FIRMWARE_S * np.ceil((stamps + delay_s) / FIRMWARE_S - 1e-6) - stamps))


def run(
    machine: Machine,
    stamps: Array,
    commands: Array,
    start: Array | None = None,
    first: float = 0.0,
    seconds: float | None = None,
) -> Run:
    """Step the machine under commands.

    Args:
        machine: it.
        stamps: of the log [s], even, from 0.
        commands: at the stamps [rad], shape (n, J).
        start: MuJoCo's positions and speeds at ``first``, shape (nq + nv,); without, it settles before.
        first: time to begin at [s].
        seconds: how long; to the last stamp without.
    """
    m = machine.model
    data = mujoco.MjData(m)
    at, dof, adds = addresses(m, machine.joints)
    settle = SETTLE_S if start is None else 0.0
    end = stamps[-1] if seconds is None else min(stamps[-1], first + seconds)
    count = int(np.ceil((settle + end - first) / STEP_S)) + 1
    times = first - settle + STEP_S * np.arange(count + 1)
    if machine.servo:  # a firmware reads what has arrived
        ctrl = commands[(np.searchsorted(stamps + machine.delay_s, times + 1e-9, side="right") - 1).clip(0)]
    else:
        ctrl = arriving(stamps, commands, machine.delay_s, times)
    if start is None:
        data.qpos[at] = commands[0]
    else:
        data.qpos[:], data.qvel[:] = start[: m.nq], start[m.nq :]
    n, law, own = len(at), machine.law, slice(0, len(at))
    q, dq, torque, outside = (np.empty((count + 1, n)) for _ in range(4))
    state = np.empty((count + 1, m.nq + m.nv))
    every, step = round(FIRMWARE_S / STEP_S), 2.0 * np.pi / machine.counts
    drive = np.zeros(n)
    emf = m.actuator_biasprm[n:, 2]
    mujoco.mj_forward(m, data)
    for k in range(count + 1):
        seen, v = adds @ data.qpos, data.qvel[dof]
        target = ctrl[min(k, count - 1)]
        if machine.servo:
            if round(times[k] / STEP_S) % every == 0 or k == 0:
                drive = (machine.kp * (target - step * np.round(seen / step))).clip(
                    -machine.most, machine.most
                )
            data.ctrl[own] = drive
            given = drive + emf * v
        else:
            data.ctrl[own] = target
            given = data.actuator_force[own].copy() if k else np.zeros(n)
        q[k], dq[k], torque[k], outside[k] = seen, v, given, -data.qfrc_bias[dof]
        state[k] = np.concatenate((data.qpos, data.qvel))
        if not law.plain:
            m.dof_frictionloss[dof] = law.budget(given, outside[k], v)
        mujoco.mj_step(m, data)
    inside = stamps[(stamps >= first - 1e-9) & (stamps <= end + 1e-9)]
    traces = (q, dq, torque, outside, state)
    return Run(*(np.column_stack([np.interp(inside, times, column) for column in x.T]) for x in traces))
