"""A seven-axis arm that is simulated with what no table knows: the machine, and forms of effects."""

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
"""Dry and viscous friction and rotors of the model, which an identified arm's lab knows. Plausible for such gears."""
CENTRE = np.array([0.0, -0.3, 0.0, -1.7, 0.0, 1.8, 0.4])
HALF_WAY = np.array([1.1, 0.8, 1.0, 0.8, 1.2, 1.0, 1.2])
"""Middle and half of the motion [rad]; inside the ranges by 0.3 rad."""
TORQUE_NOISE_NM = np.array([0.04, 0.05, 0.03, 0.03, 0.012, 0.01, 0.01])
STEP_RAD = 2.0 * np.pi / 2**17
RATE_HZ, TIMESTEP_S, SECONDS = 500.0, 5e-4, 60.0
BANDWIDTH_PER_S = 15.0
"""Bandwidth of the controller, critically damped."""
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
    """No cause has it: a resistance with the square of the speed."""
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
    """No cause has it: a torque sensor that reads some of its neighbour's."""
    torque[:, form.at] += form.size * torque[:, form.at - 1]


def _disc(form: Form, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
    """No cause has it: an encoder's disc off its axis."""
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
