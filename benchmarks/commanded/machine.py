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
    kp: np.ndarray
    most: np.ndarray
    counts: int

    def addresses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places of the joints in positions and speeds, and the matrix that adds a joint's play to its position.

        Logged positions are those behind the play. A servo's loop is closed there, too; a leg's at the motor.
        """
        own = np.array([self.model.joint(n).id for n in self.joints])
        adds = np.zeros((len(own), self.model.nq))
        adds[np.arange(len(own)), self.model.jnt_qposadr[own]] = 1.0
        for j, name in enumerate(self.joints):
            play = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, f"{name}_play")
            if play >= 0:
                adds[j, self.model.jnt_qposadr[play]] = 1.0
        return self.model.jnt_qposadr[own], self.model.jnt_dofadr[own], adds


@dataclass(frozen=True)
class Run:
    """What happened, at the stamps of the log.

    Attributes:
        q: positions behind a play, before the encoder rounds them [rad], shape (n, J).
        dq: speeds [rad/s], shape (n, J).
        torque: of the drives, back-EMF and all [N m], shape (n, J).
        outside: torque from outside, by the law's convention [N m], shape (n, J).
    """

    q: np.ndarray
    dq: np.ndarray
    torque: np.ndarray
    outside: np.ndarray


def arriving(
    stamps: np.ndarray, commands: np.ndarray, delay_s: float, count: int, begin: float
) -> np.ndarray:
    """Mean of the command in effect over each step from ``begin`` [s] on, shape (count, J).

    A command holds from its stamp plus the delay to that of the next; the first one holds before, too.
    """
    edges = begin + STEP_S * np.arange(count + 1)
    knots = stamps + delay_s
    gone = np.concatenate(
        (np.zeros((1, commands.shape[1])), np.cumsum(commands[:-1] * np.diff(knots)[:, None], axis=0))
    )
    last = np.searchsorted(knots, edges, side="right") - 1
    at = last.clip(0)
    whole = gone[at] + commands[at] * (edges - knots[at])[:, None]
    return np.diff(whole, axis=0) / STEP_S


def run(
    machine: Machine,
    stamps: np.ndarray,
    commands: np.ndarray,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    first: float = 0.0,
    seconds: float | None = None,
) -> Run:
    """Step the machine under commands.

    Args:
        machine: it.
        stamps: of the log [s], even, from 0.
        commands: at the stamps [rad], shape (n, J).
        start: positions and speeds of the joints at ``first``, shape (J,) each; without, it settles before.
        first: time to begin at [s].
        seconds: how long; to the last stamp without.
    """
    m = machine.model
    data = mujoco.MjData(m)
    at, dof, adds = machine.addresses()
    settle = SETTLE_S if start is None else 0.0
    end = stamps[-1] if seconds is None else min(stamps[-1], first + seconds)
    count = int(np.ceil((settle + end - first) / STEP_S)) + 1
    ctrl = arriving(stamps, commands, machine.delay_s, count, first - settle)
    data.qpos[at] = commands[0] if start is None else start[0]
    if start is not None:
        data.qvel[dof] = start[1]
    n, law, own = len(at), machine.law, slice(0, len(at))
    q, dq, torque, outside = (np.empty((count + 1, n)) for _ in range(4))
    every, step = round(FIRMWARE_S / STEP_S), 2.0 * np.pi / machine.counts
    drive = np.zeros(n)
    emf = m.actuator_biasprm[n:, 2]
    mujoco.mj_forward(m, data)
    for k in range(count + 1):
        seen, v = adds @ data.qpos, data.qvel[dof]
        target = ctrl[min(k, count - 1)]
        if machine.servo:
            if k % every == 0:
                drive = (machine.kp * (target - step * np.round(seen / step))).clip(
                    -machine.most, machine.most
                )
            data.ctrl[own] = drive
            given = drive + emf * v
        else:
            data.ctrl[own] = target
            given = data.actuator_force[own].copy() if k else np.zeros(n)
        q[k], dq[k], torque[k], outside[k] = seen, v, given, -data.qfrc_bias[dof]
        if not law.plain:
            m.dof_frictionloss[dof] = law.budget(given, outside[k], v)
        mujoco.mj_step(m, data)
    times = first - settle + STEP_S * np.arange(count + 1)
    inside = stamps[(stamps >= first - 1e-9) & (stamps <= end + 1e-9)]
    return Run(
        *(
            np.column_stack([np.interp(inside, times, x[:, j]) for j in range(n)])
            for x in (q, dq, torque, outside)
        )
    )
