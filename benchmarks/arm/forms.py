"""What is hidden in the arm, in forms of its own: none of them shares code, and few the law, with the catalogue.

A form has one number, its size. ``TYPICAL`` sizes are of the order of what is met; campaigns scale them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from arm.machine import BEND, RATE_HZ, SECONDS, TIMESTEP_S, Torques, late

GRAVITY = 9.81


@dataclass(frozen=True)
class Form:
    """One effect.

    Attributes:
        name: of the form.
        cause: what the catalogue calls it, None if it has no such cause.
        joint: where, from 1; None for the arm.
        size: in the form's own unit.
        seed: of what else is drawn.
    """

    name: str
    cause: str | None
    joint: int | None
    size: float
    seed: int

    @property
    def rng(self) -> np.random.Generator:
        """For its shape."""
        return np.random.default_rng([self.seed, *self.name.encode()])

    @property
    def at(self) -> int:
        """The joint from 0, the last where there is none."""
        return (self.joint or 7) - 1

    def joint_of(self, spec: mujoco.MjSpec) -> mujoco.MjsJoint:
        """The motor's joint there, whatever joints other forms have added."""
        return spec.joint(f"joint{self.at + 1}")

    def change(self, spec: mujoco.MjSpec) -> None:
        """What MJCF can say."""
        if self.name in CHANGES:
            CHANGES[self.name](self, spec)

    def torques(self, step_s: float = TIMESTEP_S) -> Torques | None:
        """What acts on the joints besides; it remembers, so that every run needs its own.

        Args:
            step_s: time between two calls [s].
        """
        return TORQUES[self.name](self, step_s) if self.name in TORQUES else None

    def force(self, t: float) -> np.ndarray:
        """On the last link [N]."""
        if self.name != "half_sine_push":
            return np.zeros(3)
        rng = self.rng
        start, lasts = rng.uniform(8.0, SECONDS - 8.0), rng.uniform(0.4, 1.5)
        way = rng.standard_normal(3)
        inside = start <= t < start + lasts
        return (
            self.size * way / np.linalg.norm(way) * (np.sin(np.pi * (t - start) / lasts) if inside else 0.0)
        )

    def read(self, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What sensors make of positions and torques, shape (n, 7) each."""
        if self.name not in READINGS:
            return q, torque
        q, torque = q.copy(), torque.copy()
        READINGS[self.name](self, time, q, torque)
        return q, torque


def _sliding(
    form: Form, step_s: float, bristle_rad: float, level: Callable[[float, float], float]
) -> Torques:
    """Dry friction as a bristle that bends by a small angle before it slips (Dahl, LuGre), at a level of its own."""
    at, bent = form.at, 0.0

    def torque(q: np.ndarray, v: np.ndarray, drive: np.ndarray, t: float) -> np.ndarray:
        nonlocal bent
        speed, most = float(v[at]), max(level(float(v[at]), float(drive[at])), 1e-12)
        # Bent as far as the level asks; exact over a step of constant speed.
        goal = most if speed >= 0 else -most
        bent = goal + (bent - goal) * np.exp(-abs(speed) * step_s / bristle_rad)
        out = np.zeros(len(v))
        out[at] = -bent
        return out

    return torque


def _lugre(form: Form, step_s: float) -> Torques:
    """A quarter more at rest than in motion, and viscous besides."""
    own = _sliding(form, step_s, 8e-4, lambda v, _: form.size * (1.0 + 0.25 * np.exp(-((v / 0.05) ** 2))))
    viscous = form.size * form.rng.uniform(0.0, 0.6)

    def torque(q: np.ndarray, v: np.ndarray, drive: np.ndarray, t: float) -> np.ndarray:
        out = own(q, v, drive, t)
        out[form.at] -= viscous * v[form.at]
        return out

    return torque


def _dahl(form: Form, step_s: float) -> Torques:
    return _sliding(form, step_s, 2e-3, lambda *_: form.size)


def _stiction(form: Form, step_s: float) -> Torques:
    """Breaks loose at more than it slides with; falls with the speed's first power in the exponent."""
    fast = form.rng.uniform(0.03, 0.1)
    return _sliding(form, step_s, 5e-4, lambda v, _: form.size * np.exp(-abs(v) / fast))


def _one_way(form: Form, step_s: float) -> Torques:
    """Rubs more forwards than backwards."""
    half = 0.5 * form.size
    return _sliding(form, step_s, 8e-4, lambda v, _: half * (1.0 + np.tanh(v / 0.01)) + 1e-9)


def _grease(form: Form, step_s: float) -> Torques:
    """Shear-thinning: over the speed as its logarithm."""
    return _sliding(form, step_s, 8e-4, lambda v, _: form.size * np.log1p(abs(v) / 0.15))


def _meshing(form: Form, step_s: float) -> Torques:
    """Teeth under load: a little more than in proportion to it."""
    return _sliding(form, step_s, 8e-4, lambda v, drive: form.size * abs(drive) ** 1.15)


def _at(form: Form, formula: Callable[[float, float, float], float]) -> Torques:
    def torque(q: np.ndarray, v: np.ndarray, drive: np.ndarray, t: float) -> np.ndarray:
        out = np.zeros(len(v))
        out[form.at] = formula(float(q[form.at]), float(v[form.at]), t)
        return out

    return torque


def _cogging(form: Form, step_s: float) -> Torques:
    """Twice a turn, with a harmonic."""
    a, b = form.rng.uniform(0.0, 2.0 * np.pi, 2)
    return _at(form, lambda q, v, t: form.size * (np.sin(2.0 * q + a) + 0.15 * np.sin(4.0 * q + b)))


def _cable(form: Form, step_s: float) -> Torques:
    """A dress pack that stiffens as it is wound."""
    return _at(form, lambda q, v, t: -form.size * (q + 0.2 * q**3))


def _balancer(form: Form, step_s: float) -> Torques:
    """A tension spring between two pins, whose length is that of a triangle's side."""
    a, b, rest, where = 0.12, 0.3, 0.1, form.rng.uniform(0.0, 2.0 * np.pi)

    def pull(q: float, v: float, t: float) -> float:
        length = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(q + where))
        return -form.size * (length - rest) * a * b * np.sin(q + where) / length

    return _at(form, pull)


def _pair(form: Form, step_s: float) -> Torques:
    """A motor that turns with the difference of this joint and the one before, and rubs there."""
    at, bent = form.at, 0.0

    def torque(q: np.ndarray, v: np.ndarray, drive: np.ndarray, t: float) -> np.ndarray:
        nonlocal bent
        speed = float(v[at] - v[at - 1])
        bent = np.sign(speed) + (bent - np.sign(speed)) * np.exp(-abs(speed) * step_s / 1e-3)
        out = np.zeros(len(v))
        out[at], out[at - 1] = -form.size * bent, form.size * bent
        return out

    return torque


def _weekly(form: Form, step_s: float) -> Torques:
    """A joint's friction that fades as the arm warms up."""
    return _timed(form, step_s, lambda t: np.exp(-t / 15.0))


def _timed(form: Form, step_s: float, share: Callable[[float], float]) -> Torques:
    own = _sliding(form, step_s, 8e-4, lambda *_: form.size)

    def torque(q: np.ndarray, v: np.ndarray, drive: np.ndarray, t: float) -> np.ndarray:
        return share(t) * own(q, v, drive, t)

    return torque


def _drag(form: Form, step_s: float) -> Torques:
    """Of no cause: a resistance with the square of the speed."""
    return _at(form, lambda q, v, t: -form.size * v * abs(v))


def _rotor(form: Form, spec: mujoco.MjSpec) -> None:
    form.joint_of(spec).armature += form.size


def _load(form: Form, spec: mujoco.MjSpec) -> None:
    """A box, off the flange's axis, that is turned."""
    rng = form.rng
    box = spec.bodies[-1].add_body()
    box.mass, box.explicitinertial = form.size, True
    box.pos = [*rng.uniform(-0.03, 0.03, 2), rng.uniform(0.1, 0.25)]
    box.quat = rng.standard_normal(4)
    a, b, c = rng.uniform(0.03, 0.09, 3) ** 2
    box.inertia = form.size / 3.0 * np.array([b + c, a + c, a + b])


def _tilt(form: Form, spec: mujoco.MjSpec) -> None:
    way = form.rng.uniform(0.0, 2.0 * np.pi)
    x, y = form.size * np.array([np.cos(way), np.sin(way)])
    spec.option.gravity = np.asarray(spec.option.gravity) + GRAVITY * np.array([x, y, 0.0])


def _yielding(form: Form, spec: mujoco.MjSpec) -> None:
    """A spring between rotor and link, 5 ms of damping; the encoder sits at the motor, where the bearings rub."""
    motor = form.joint_of(spec)
    bend = motor.parent.add_joint()
    bend.name = f"{BEND}{form.at + 1}"
    bend.type, bend.axis, bend.pos = motor.type, motor.axis, motor.pos
    bend.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    bend.stiffness = [1.0 / form.size, 0.0, 0.0]
    bend.damping = [5e-3 / form.size, 0.0, 0.0]


def _warm_offset(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    torque[:, form.at] += form.size * (1.0 - 0.2 * np.exp(-time / 15.0))


def _gain(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """A torque constant, with iron that saturates a little."""
    own = torque[:, form.at]
    much = 3.0 * np.sqrt(np.mean(own**2))
    torque[:, form.at] = own + form.size * own / np.sqrt(1.0 + (own / much) ** 2)


def _slow_torque(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """Half of it a lag of first order, half of it transport."""
    from scipy.signal import lfilter

    half = 0.5 * form.size
    torque[:] = np.where(np.arange(7) == form.at, late(time, torque, half), torque)
    keep = np.exp(-1.0 / (RATE_HZ * max(half, 1e-9)))
    own = torque[:, form.at]
    torque[:, form.at] = own[0] + lfilter([1.0 - keep], [1.0, -keep], own - own[0])


def _zero(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """With the disc a little off its axis."""
    turned = 0.15 * np.sin(q[:, form.at] + form.rng.uniform(0.0, 2.0 * np.pi))
    q[:, form.at] += form.size * (1.0 + turned)


def _weighing(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """Of no cause: a torque sensor that reads some of its neighbour's."""
    torque[:, form.at] += form.size * torque[:, form.at - 1]


def _disc(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """Of no cause: an encoder's disc off its axis."""
    q[:, form.at] += form.size * np.sin(q[:, form.at] + form.rng.uniform(0.0, 2.0 * np.pi))


TORQUES: dict[str, Callable[[Form, float], Torques]] = {
    "lugre": _lugre, "dahl": _dahl, "stiction": _stiction, "one_way": _one_way, "grease": _grease,
    "meshing": _meshing, "cogging": _cogging, "cable": _cable, "balancer": _balancer, "pair": _pair,
    "warming_friction": _weekly, "quadratic_drag": _drag,
}  # fmt: skip
CHANGES = {"rotor": _rotor, "load": _load, "tilt": _tilt, "yielding": _yielding}
READINGS = {
    "warm_offset": _warm_offset, "gain": _gain, "slow_torque": _slow_torque, "zero": _zero,
    "neighbour": _weighing, "eccentric": _disc,
}  # fmt: skip

CAUSE_OF: dict[str, str | None] = {
    "lugre": "friction", "dahl": "friction", "stiction": "stribeck", "one_way": "asymmetric_coulomb",
    "grease": "sublinear_friction", "meshing": "load_friction", "cogging": "ripple", "cable": "spring",
    "balancer": "counterbalance", "pair": "coupled_drive", "rotor": "armature", "load": "payload",
    "tilt": "gravity_direction", "warm_offset": "torque_offset", "gain": "torque_scale",
    "slow_torque": "torque_delay", "zero": "joint_zero", "yielding": "elasticity", "half_sine_push": "push",
    "warming_friction": "warming", "quadratic_drag": None, "neighbour": None, "eccentric": None,
}  # fmt: skip
"""What the catalogue calls a form."""
TYPICAL: dict[str, float] = {
    "lugre": 0.3, "dahl": 0.3, "stiction": 0.3, "one_way": 0.3, "grease": 0.2, "meshing": 0.02, "cogging": 0.3,
    "cable": 0.5, "balancer": 50.0, "pair": 0.2, "rotor": 0.05, "load": 0.3, "tilt": 0.01, "warm_offset": 0.2,
    "gain": 0.03, "slow_torque": 2e-3, "zero": 5e-3, "yielding": 1e-4, "half_sine_push": 5.0,
    "warming_friction": 0.3, "quadratic_drag": 0.2, "neighbour": 0.02, "eccentric": 3e-3,
}  # fmt: skip
MOST: dict[str, float] = {
    "tilt": 0.3, "gain": 0.6, "slow_torque": 0.02, "zero": 0.1, "yielding": 2e-3, "load": 6.0, "neighbour": 0.5,
    "eccentric": 0.1, "meshing": 0.3,
}  # fmt: skip
"""Beyond which it is no effect but a wreck."""
NOT_FIRST = ("pair", "neighbour", "zero")
"""At no first joint: there is none before it, and a zero of an upright axis shows in nothing."""
NOWHERE = ("tilt", "load", "half_sine_push")
"""At no joint."""
