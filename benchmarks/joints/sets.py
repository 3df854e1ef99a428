"""Sets of an arm with something hidden, at sizes over its detection limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

from discrepancy.evidence.cells import Cells
from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.search import Search, floor_of
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import Given, JointProblem, joint_problem
from discrepancy.joints.trials import trials_of
from joints import arm as machine
from joints.arm import CAUSE_OF, MOST, NOT_FIRST, NOWHERE, TYPICAL, Form
from mocobot_logs.joints.joint_log import JointLog


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

    From the same reference, where a joint bends.
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
        search: on the healthy arm's log.
        ideal: the log without noise as a problem.
    """

    rng: Callable[[str], np.random.Generator]
    arm: machine.Healthy
    motion: machine.Motion
    search: Search
    ideal: JointProblem

    @classmethod
    def of(cls, rng: Callable[[str], np.random.Generator], model: SerialModel, healthy: JointLog) -> Shown:
        """From the healthy arm's log."""
        trials = trials_of(model, [healthy])
        problem = joint_problem(model, trials.runs, None, Given(noise=trials.noise))
        arm = machine.healthy(rng("arm"), 0.0)
        motion = machine.moved(arm.spec, rng("motion"))
        ideal = machine.logged("ideal", motion.time, *read(arm, (), motion), None)
        search = Search(problem, floor_of(problem, problem.slabs()))
        return cls(rng, arm, motion, search, joint_problem(model, trials_of(model, [ideal]).runs))

    def limit(self, form: Form) -> float:
        """Size from which a form is noticed nine times in ten, as the diagnosis says it of its causes."""
        need = (
            np.sqrt(2.0 * (self.search.against + self.search.settings.need_nats))
            + self.search.settings.noticed
        )
        return float(form.size * need / np.sqrt(self.by(form)))

    def by(self, form: Form) -> float:
        """What a form leaves of chi-square beside everything within its tolerance."""
        changed = _with(form, self.arm, self.motion, self.rng("motion"))
        runs, problem = trials_of(self.ideal.model, [changed]).runs, self.ideal
        after = joint_problem(problem.model, runs).residual
        change = [b - a for a, b in zip(problem.residual, after, strict=True)]
        cells = Cells.of(problem.cells.bands, change)
        cells.add(problem.rows(problem.series))
        noise = self.search.fixed(()).posterior.variance
        posterior = Posterior(cells, problem.prior((), None), noise)
        out = 0.0
        for channel, variance in zip(cells.channels, noise, strict=True):
            fitted = channel.products @ posterior.mean[channel.columns]
            out += float(np.sum((channel.squares - fitted) / variance))
        return out


KINDS = ("clean", "single", "single", "pairs", "single", "clean", "single", "unlisted", "triples", "left-out")
"""Kinds of successive seeds."""
SIZES = (2.0, 4.0, 4.0, 8.0)
"""Over the limit, of successive effects in turn by seed."""
Kind = Literal["clean", "single", "pairs", "triples", "unlisted", "left-out"]
LISTED = tuple(name for name, cause in CAUSE_OF.items() if cause)
UNLISTED = tuple(name for name, cause in CAUSE_OF.items() if not cause)


@dataclass(frozen=True)
class ArmSet:
    """What is hidden in one log; equal ones give equal bits.

    Attributes:
        seed: of everything random.
        kind: what kind of set.
        factor: size of its effects over their limits; None draws it.
        noise: of positions [rad] and torques [N m] in place of the arm's own.
    """

    seed: int
    kind: Kind
    factor: float | None = None
    noise: tuple[float, float] | None = None

    @classmethod
    def of(cls, seed: int, kind: Kind | None = None, factor: float | None = None) -> ArmSet:
        """The kind follows from the seed where none is given."""
        return cls(seed, kind or KINDS[seed % len(KINDS)], factor)  # type: ignore[arg-type]

    def rng(self, purpose: str) -> np.random.Generator:
        """For one purpose."""
        return np.random.default_rng([self.seed, *purpose.encode()])

    @cached_property
    def forms(self) -> tuple[Form, ...]:
        """What is hidden, at typical sizes."""
        if self.kind == "clean":
            return ()
        rng = self.rng("forms")
        pool = UNLISTED if self.kind == "unlisted" else LISTED
        number = {"pairs": 2, "triples": 3}.get(self.kind, 1)
        # Every form in turn, in an order that differs from turn to turn.
        turn, k = divmod(self.seed, len(pool))
        first = np.random.default_rng([turn, *b"turn"]).permutation(len(pool))[k]
        names = [pool[first]]
        while len(names) < number:
            name = str(rng.choice(pool))
            if CAUSE_OF[name] not in [CAUSE_OF[n] for n in names]:
                names.append(name)
        out = []
        for i, name in enumerate(names):
            joint = None if name in NOWHERE else int(rng.integers(2 if name in NOT_FIRST else 1, 8))
            out.append(Form(name, CAUSE_OF[name], joint, TYPICAL[name], self.seed + i))
        return tuple(out)

    @property
    def excluded(self) -> tuple[str, ...]:
        """Causes taken out of the catalogue."""
        return tuple(f.cause for f in self.forms if f.cause) if self.kind == "left-out" else ()


@dataclass(frozen=True)
class Made:
    """A log with its truth."""

    log: JointLog
    truth: dict[str, Any]


def make(request: ArmSet, folder: Path) -> Made:
    """Simulate the healthy arm, size the effects by it, simulate again with them.

    Raises:
        RuntimeError: the arm with these effects did not follow its reference.
    """
    arm = machine.healthy(request.rng("arm"))
    motion = machine.moved(arm.spec, request.rng("motion"))
    q, torque = read(arm, (), motion)
    clean = machine.logged("clean", motion.time, q, torque, request.rng("noise"), request.noise)
    shown = Shown.of(request.rng, machine.nominal(folder), clean) if request.forms else None
    sized, told = [], []
    sizes = request.rng("sizes")
    for k, form in enumerate(request.forms):
        limit = shown.limit(form)
        wanted = request.factor or SIZES[(request.seed + k) % len(SIZES)] * sizes.uniform(0.9, 1.1)
        size = min(wanted * limit, MOST.get(form.name, np.inf))
        sized.append(replace(form, size=float(size)))
        told.append(
            asdict(sized[-1])
            | {"limit": float(limit), "factor": float(size / limit), "wanted": float(wanted)}
        )
    if sized:
        spec = arm.spec.copy()
        for form in sized:
            form.change(spec)
        besides = [t for form in sized if (t := form.torques()) is not None]
        pushes = [form for form in sized if form.name == "half_sine_push"]
        motion = machine.moved(
            spec,
            request.rng("motion"),
            besides,
            (lambda t: np.sum([f.force(t) for f in pushes], axis=0)) if pushes else None,
        )
        q, torque = read(arm, sized, motion)
    log = machine.logged("log", motion.time, q, torque, request.rng("noise"), request.noise)
    return Made(log, {"effects": told})
