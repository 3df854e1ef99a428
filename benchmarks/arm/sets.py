"""Data sets of the arm: what is hidden, how large, and the log."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from arm import machine
from arm.forms import CAUSE_OF, MOST, NOT_FIRST, NOWHERE, TYPICAL, Form
from arm.limits import Shown, read
from mocobot_logs.joints.joint_log import JointLog

KINDS = ("clean", "single", "single", "pairs", "single", "clean", "single", "unlisted", "triples", "left-out")
"""Of successive seeds."""
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
