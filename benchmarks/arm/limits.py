"""From which size on an effect in the arm can be found: what it shows beside all that healthy arms are off by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from discrepancy.serial.logs import parts_of
from discrepancy.serial.rig import SerialRig

from arm import machine
from arm.forms import Form
from discrepancy.candidate import Candidate
from discrepancy.rules import inference
from mocobot_logs.joints.joint_log import JointLog

GAIN = 38.0
"""Of chi-square over noise and tolerances, at the detection limit: found nine times in ten (``mocobot.campaign``)."""


def read(
    arm: machine.Healthy, forms: tuple[Form, ...] | list[Form], motion: machine.Motion
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and torques as they are read of a motion, shape (n, 7) each."""
    q, torque = motion.q + arm.zero, machine.late(motion.time, motion.torque * arm.scale, arm.delay_s)
    for form in forms:
        q, torque = form.read(motion.time, q, torque)
    return q, torque


def _with(form: Form, arm: machine.Healthy, motion: machine.Motion, rng: np.random.Generator) -> JointLog:
    """The log of the same motion, if the form were there: drives give what it takes.

    Of the same reference, where a joint bends.
    """
    if form.name == "yielding":
        spec = arm.spec.copy()
        form.change(spec)
        motion = machine.moved(spec, rng)
        return machine.logged("form", motion.time, *read(arm, (), motion), None)
    torque = motion.torque.copy()
    if (own := form.torques(1.0 / machine.RATE_HZ)) is not None:
        for k, t in enumerate(motion.time):
            torque[k] -= own(motion.q[k], motion.dq[k], motion.torque[k], float(t))
    spec = arm.spec.copy()
    form.change(spec)
    before, after = arm.spec.copy().compile(), spec.compile()
    pushed = form.name == "half_sine_push"
    if form.name in ("rotor", "load", "tilt") or pushed:
        torque += _asked(after, motion, form) - _asked(before, motion, None)
    q, torque = read(arm, [form], replace(motion, torque=torque))
    return machine.logged("form", motion.time, q, torque, None)


def _asked(model: mujoco.MjModel, motion: machine.Motion, form: Form | None) -> np.ndarray:
    """Torques of a motion by MuJoCo, shape (n, 7)."""
    data, out = mujoco.MjData(model), np.empty_like(motion.q)
    jacobian = np.empty((3, model.nv))
    last = machine.model_spec().bodies[-1].name
    body = model.body(last).id
    for k in range(len(motion.time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = motion.q[k], motion.dq[k], motion.ddq[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse
        if form is not None:
            mujoco.mj_jacBodyCom(model, data, jacobian, None, body)
            out[k] -= jacobian.T @ form.force(float(motion.time[k]))
    return out


@dataclass(frozen=True, eq=False)
class Shown:
    """What effects show, each alone, on an arm that is as its model says, in the noise of the healthy one's log.

    On another one a payload of a kilogram times an angle that is off by some milliradians shows as well: a fit of that
    arm has both, and nothing of it is the payload's.

    Attributes:
        rng: of the set, for a purpose.
        arm, motion: without errors, along the same reference.
        rig: its log without noise, whitened as the healthy one's.
    """

    rng: Callable[[str], np.random.Generator]
    arm: machine.Healthy
    motion: machine.Motion
    rig: SerialRig

    @classmethod
    def of(cls, rng: Callable[[str], np.random.Generator], healthy: SerialRig) -> Shown:
        """From the rig of the healthy arm's log."""
        arm = machine.healthy(rng("arm"), 0.0)
        motion = machine.moved(arm.spec, rng("motion"))
        ideal = machine.logged("ideal", motion.time, *read(arm, (), motion), None)
        rig = SerialRig.of(healthy.model, [ideal])
        return cls(
            rng, arm, motion, replace(rig, whitening=healthy.whitening, spoilt=healthy.spoilt, _seen={})
        )

    def limit(self, form: Form) -> float:
        """Size from which a form is found: what is not so far out of its tolerance is no fault."""
        gain, tolerances = self.by(form)
        return float(form.size * max(np.sqrt(GAIN / gain), inference.LEAST_SLAB / max(tolerances, 1e-9)))

    def by(self, form: Form) -> tuple[float, float]:
        """What a form leaves of chi-square beside everything within its tolerance, and its size in tolerances.

        The latter is that of its cause's nearest values, in the nearest shape; infinite where that has no tolerance.
        """
        rig = self.rig
        changed = _with(form, self.arm, self.motion, self.rng("motion"))
        parts, _ = parts_of(rig.model, [changed], rig.motors)
        after = replace(rig, parts=parts, _seen={}, traces={}).physical_residual([])
        change = [b - a for a, b in zip(rig.physical_residual([]), after, strict=True)]
        d = self._white([rows[..., None] for rows in change])[:, 0]
        within = [c for c in rig.candidates() if all(p.tolerance > 0 for p in c.parameters)]
        X = np.concatenate([self._columns(c) for c in within], axis=1)
        x = np.linalg.solve(X.T @ X + np.eye(X.shape[1]), X.T @ d)
        own = [c for c in within if (c.cause, c.joint) == (form.cause, form.joint)]
        near = [self._nearest(shape, d) for c in own for shape in (c, *rig.refinements(c))]
        return float(d @ d - d @ (X @ x)), min(near)[1] if near else np.inf

    def _nearest(self, candidate: Candidate, d: np.ndarray) -> tuple[float, float]:
        """What a cause leaves of an effect's rows, and its largest value in tolerances."""
        X = self._columns(candidate)
        x = np.linalg.lstsq(X, d, rcond=None)[0]
        return float(np.sum((d - X @ x) ** 2)), float(np.abs(x).max())

    def _columns(self, candidate: Candidate) -> np.ndarray:
        """Of a cause, a tolerance each, shape (rows, k)."""
        return self._white(self.rig.physical(candidate)) * [p.tolerance for p in candidate.parameters]

    def _white(self, physical: Sequence[np.ndarray]) -> np.ndarray:
        """Rows (n, C, k) of every block without what rest may hide, shape (rows, k)."""
        out = []
        for t, (white, rows) in enumerate(zip(self.rig.whitening, physical, strict=True)):
            x = white(rows).reshape(-1, rows.shape[2])
            own = self.rig.local_columns(t)
            if own.size:
                Q, _ = np.linalg.qr(own.reshape(len(x), -1))
                x = x - Q @ (Q.T @ x)
            out.append(x)
        return np.concatenate(out)
