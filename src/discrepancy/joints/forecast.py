"""Forecast positions from commands alone: MuJoCo simulates the robot and its position loops from a known state."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from scipy.signal import coherence, csd, welch

from discrepancy.joints.closed_loop import ClosedLoop
from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import SerialModel
from estimator.arrays import Array
from mocobot_sim.serial.mjcf import SOLIMP, SOLREF

STEP_S = 1e-3
"""Longest integration step [s]. Chosen: errors of the integration are then as small as those of encoders."""
WINDOW_S = 1.0
"""Length of a forecast [s]."""
LOST = 3.0
"""Error at which a forecast is lost [rad or m]; it counts with that error from there on. Chosen: half a turn."""
SERIES = "command", "measured", "model", "calibrated"
RESPONSE = "frequency_Hz", *SERIES[1:]
POINTS, MOST_HZ = 300, 50.0
"""Most instants of a forecast that are kept, and most of them a second. Chosen: an oscillation of 10 Hz has a form."""
SEGMENT_S, COHERENT = 4.0, 0.8
"""Length of the spectra's segments [s], and least coherence of command and measured position. Chosen."""


@dataclass(frozen=True, eq=False)
class Forecasts:
    """Positions of one part of the logs, and what the given and the calibrated model make of its commands.

    Attributes:
        part: name of the part.
        time: instants in its middle, shape (K,) [s].
        positions: by joint, columns ``SERIES``, simulated ones in windows of one second, shape (K, 4) [rad or m].
        responses: by joint, columns ``RESPONSE``: frequency [Hz] and amplitude of the position over that of the
            command, simulated ones of the whole part without a new start, shape (F, 4).
    """

    part: str
    time: Array
    positions: Mapping[int, Array]
    responses: Mapping[int, Array]

    @classmethod
    def of(
        cls, part: str, loop: ClosedLoop, steps: slice, off: Sequence[Array], whole: Sequence[Array]
    ) -> Forecasts:
        """Keep what a page shows of a part.

        Args:
            part: its name.
            loop: the log with its estimated motion.
            steps: steps of the grid.
            off: results of ``errors`` for both models in windows of one second.
            whole: the same in one window.
        """
        log, first = loop.signals.log, loop.first
        assert log.command is not None
        rows = np.arange(-(-steps.start // loop.every) + 1, steps.stop // loop.every)
        thin = max(1, round(log.rate_hz / MOST_HZ))
        kept = rows[(len(rows) - min(POINTS * thin, len(rows))) // 2 :][: POINTS * thin : thin]
        positions, responses = {}, {}
        for j in range(len(log.joints)):
            command, q = log.command[first:, j], loop.measured[:, j]
            positions[j] = np.column_stack([x[kept] for x in (command, q, *(q + x[:, j] for x in off))])
            q = log.q[first:, j]
            moved = [q[rows], *(q[rows] + np.nan_to_num(x[rows, j]) for x in whole)]
            responses[j] = _response(log.rate_hz, command[rows], moved)
        return cls(part, log.time[first + kept], positions, responses)


def _response(rate_hz: float, command: Array, moved: Sequence[Array]) -> Array:
    """Amplitudes of positions over that of a command where the first follows it, columns ``RESPONSE``."""
    cut = {"fs": rate_hz, "nperseg": min(len(command), round(SEGMENT_S * rate_hz))}
    frequency, power = welch(command, **cut)
    seen = (coherence(command, moved[0], **cut)[1] > COHERENT) & (power > 0.0) & (frequency > 0.0)
    gains = [np.abs(csd(command, x, **cut)[1][seen] / power[seen]) for x in moved]
    return np.column_stack([frequency[seen], *gains])


def machine(model: SerialModel, given: Tree, found: Tree) -> mujoco.MjModel:
    """The compiled model with the numbers of another tree, ready to be driven by torques; negative damping is left out.

    Args:
        model: the robot as described.
        given: its kinematic tree.
        found: the same with other numbers.
    """
    m = copy.copy(model.model)
    m.body_mass[:], m.body_ipos[:], m.body_pos[:] = found.mass, found.com, found.position
    changed = np.flatnonzero((found.inertia != given.inertia).any(axis=(1, 2)))
    for b in changed:
        size, axes = np.linalg.eigh(found.inertia[b])
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        m.body_inertia[b] = np.maximum(size, 0.0)
        mujoco.mju_mat2Quat(m.body_iquat[b], axes.ravel())
    own = m.jnt_dofadr[model.coupling.own]
    m.dof_armature[own] += found.armature - given.armature
    m.dof_frictionloss[own] += found.coulomb - given.coulomb
    m.dof_damping[own] += np.maximum(found.viscous, 0.0) - given.viscous
    m.dof_dampingpoly[own] += found.drag - given.drag
    off = mujoco.mjtDisableBit
    for bit in (off.mjDSBL_CONTACT, off.mjDSBL_LIMIT, off.mjDSBL_ACTUATION, off.mjDSBL_AUTORESET):
        m.opt.disableflags |= int(bit)
    m.opt.gravity, m.dof_solref[:], m.dof_solimp[:] = found.gravity, SOLREF, SOLIMP
    mujoco.mj_setConst(m, mujoco.MjData(m))
    return m


def errors(
    m: mujoco.MjModel, model: SerialModel, loop: ClosedLoop, servos: Array, zero: Array, late: Array, steps: slice,
) -> Array:  # fmt: skip
    """Forecast minus measured positions in consecutive windows, shape (M, J); NaN where none was measured.

    Args:
        m: result of ``machine``.
        model: the robot as described.
        loop: the log with its estimated motion, from which every window starts.
        servos: position gain, velocity gain, torque added, and largest torque of each loop, shape (J, 4).
        zero, late: joint zeros and delays of the commands [s], shape (J,).
        steps: steps of the grid to forecast; its step is the length of a window, one second if missing.
    """
    h, data, own = loop.step_s, mujoco.MjData(m), model.coupling.own
    (kp, kd, more, limit), on = servos.T, loop.gains(len(loop.q) - 1)[3] > 0.0
    command, added = loop.told(late)
    target = command + zero + (added / loop.gains(1)[0] + more / kp)
    at, dof = m.jnt_qposadr[own], m.jnt_dofadr[own]
    stiffness, spring, damping = m.jnt_stiffness[own], m.qpos_spring[at], m.dof_damping[dof]
    every = max(1, int(np.ceil(h / STEP_S - 1e-9)))
    m.opt.timestep = h / every
    # RK4 is stable if its step is shorter than the fastest decay.
    slow = bool(np.all(m.dof_invweight0[dof] * (damping + kd) * m.opt.timestep < 1.0))
    kind = mujoco.mjtIntegrator
    m.opt.integrator = int(kind.mjINT_RK4 if slow else kind.mjINT_IMPLICITFAST)
    out = np.full(loop.measured.shape, np.nan)
    long = max(loop.every, (steps.step or round(WINDOW_S / h)) // loop.every * loop.every)
    begin = -(-steps.start // loop.every) * loop.every
    for first in range(begin, steps.stop - loop.every + 1, long):
        mujoco.mj_resetData(m, data)
        q, dq = model.coupling.all(loop.q[first] + zero, loop.dq[first])
        data.qpos[:], data.qvel[:] = q, dq
        lost = False
        for n in range(first, min(first + long, steps.stop)):
            for _ in range(every):
                if lost:
                    break
                asked = kp * (target[n] - data.qpos[at]) - kd * data.qvel[dof]
                free = on[n] & (np.abs(asked) < limit)
                # Springs and dampers act within a step, too, and not only between steps.
                m.jnt_stiffness[own], m.dof_damping[dof] = stiffness + free * kp, damping + free * kd
                m.qpos_spring[at] = np.where(
                    free, (stiffness * spring + kp * target[n]) / (stiffness + kp), spring
                )
                data.qfrc_applied[dof] = np.where(free, 0.0, on[n] * np.clip(asked, -limit, limit))
                mujoco.mj_step(m, data)
                lost = not np.abs(data.qpos[at] - loop.q[n]).max() < LOST
            if (n + 1) % loop.every == 0:
                row = (n + 1) // loop.every
                out[row] = LOST if lost else data.qpos[at] - zero - loop.measured[row]
    m.jnt_stiffness[own], m.qpos_spring[at], m.dof_damping[dof] = stiffness, spring, damping
    return np.where(np.isnan(loop.measured), np.nan, out)
