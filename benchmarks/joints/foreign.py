"""Robots that no table was made for: a maker's model, what the true one has besides, and its logs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from discrepancy.serial.model import SerialModel, load_model
from discrepancy.serial.recording.joint_log import Drive, JointLog

TIMESTEP_S, RATE_HZ, SECONDS, LOGS = 5e-4, 1000.0, 30.0, 2
BANDWIDTH_PER_S = 15.0
SHAPES = ("scara", "gantry", "leg", "rail", "chain3", "chain4", "chain5", "chain6", "chain7", "ur", "industrial")
FAULTS = ("payload", "armature", "torque_scale", "spring", "joint_zero", "torque_offset", "torque_delay")
Axis = tuple[float, float, float]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Link:
    """A moving link: its joint, its place on the one before [m], its mass [kg], where its material ends [m]."""

    axis: Axis
    pos: Axis
    mass: float
    end: Axis
    centre: float = 0.0
    slides: bool = False


def links(shape: str, rng: np.random.Generator) -> list[Link]:
    """A robot of a shape, with random lengths and masses."""
    u = rng.uniform
    if shape in ("ur", "industrial"):
        m = np.sort(u(1.0, 15.0, 6))[::-1]
        a, b, c = u(0.3, 0.6), u(0.25, 0.55), u(0.06, 0.12)
        if shape == "ur":
            return [
                Link(Z, (0, 0, 0.15), m[1], (0, 0.1, 0)),
                Link(Y, (0, 0.13, 0), m[0], (a, 0, 0), -0.9),
                Link(Y, (a, -0.1, 0), m[2], (b, 0, 0), 1.2),
                Link(Y, (b, 0, 0), m[3], (0, c, 0), -0.5),
                Link(Z, (0, c, 0), m[4], (0, 0, -c), 0.4),
                Link(Y, (0, 0, -c), m[5], (0, c, 0)),
            ]
        return [
            Link(Z, (0, 0, 0.3), m[0], (u(0.05, 0.3), 0, 0.1)),
            Link(Y, (u(0.05, 0.3), 0, 0.1), m[1], (0, 0, a), 0.2),
            Link(Y, (0, 0, a), m[2], (0.1, 0, 0.08), -0.1),
            Link(X, (0.1, 0, u(0.0, 0.1)), m[3], (b, 0, 0)),
            Link(Y, (b, 0, 0), m[4], (c, 0, 0), 0.6),
            Link(X, (c, 0, 0), m[5], (0.03, 0.01, 0)),
        ]
    m = np.sort(u(1.0, 8.0, 7))[::-1]
    if shape == "scara":
        a, b = u(0.2, 0.4, 2)
        return [
            Link(Z, (0, 0, 0.3), m[0], (a, 0, 0)),
            Link(Z, (a, 0, 0), m[1], (b, 0, 0), 0.8),
            Link(Z, (b, 0, 0), m[4], (0, 0, -0.2), 0.0, True),
            Link(Z, (0, 0, -0.2), m[6], (0.04, 0, -0.03)),
        ]
    if shape == "gantry":
        return [
            Link(X, (0, 0, 1), 2 * m[0], (0, 0.8, 0), 0.0, True),
            Link(Y, (0, 0.4, 0), m[1], (0.1, 0, 0.1), 0.0, True),
            Link(Z, (0.1, 0, 0), m[3], (0, 0, -0.5), 0.0, True),
            Link(Z, (0, 0, -0.4), m[5], (0.05, 0, -0.1)),
            Link(Y, (0, 0, -0.1), m[6], (0.05, 0, -0.15), 0.2),
        ]
    if shape == "leg":
        a, b = u(0.2, 0.45, 2)
        return [
            Link(X, (0, 0, 1), m[1], (0, 0.1, 0)),
            Link(Y, (0, 0.1, 0), m[0], (0, 0, -a), -0.6),
            Link(Y, (0, 0, -a), m[3], (0, 0, -b), 1.2),
            Link(Y, (0, 0, -b), m[5], (0.15, 0, -0.03), -0.5),
        ]
    rail = [Link(Y, (0, 0, 0.4), 2 * m[0], (0, 0.3, 0.1), 0.0, True)] if shape == "rail" else []
    out, last = rail, None
    for k in range(4 if rail else int(shape[-1])):
        choice = [c for c in (X, Y, Z) if k and (c != last or rng.random() < 0.3)] or [Z]
        last = axis = choice[int(rng.integers(len(choice)))]
        way = rng.standard_normal(3) * [1.0, 0.4, 0.7]
        end = tuple(u(0.12, 0.4) * way / np.linalg.norm(way))
        before = out[-1].end if out and not (rail and not k) else (0, 0, 0.3)
        out = [*out, Link(axis, before, m[k], end, u(-0.8, 0.8))]
    return out


def spec_of(chain: list[Link], rotor: np.ndarray) -> mujoco.MjSpec:
    """The maker's model: rods, with rotors but no friction."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    body = spec.worldbody
    for k, link in enumerate(chain):
        body = body.add_body(name=f"link{k + 1}", pos=link.pos)
        end = np.asarray(link.end, dtype=float)
        length = float(np.linalg.norm(end))
        rod, own = end / length, 0.25 * link.mass * 0.05**2 * 2
        side = np.cross(rod, [0.31, 0.57, 0.76])
        body.mass, body.explicitinertial = link.mass, True
        body.ipos = 0.45 * end + 0.02 * side
        full = (link.mass * length**2 / 12 + own) * (np.eye(3) - np.outer(rod, rod)) + own * np.outer(rod, rod)
        body.fullinertia = [full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2]]
        kind = mujoco.mjtJoint.mjJNT_SLIDE if link.slides else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name=f"joint{k + 1}", type=kind, axis=link.axis, armature=rotor[k])
    spec.option.timestep, spec.option.integrator = TIMESTEP_S, mujoco.mjtIntegrator.mjINT_EULER
    return spec


@dataclass
class Truth:
    """What the true robot has besides: friction by its numbers a joint, faults, errors within tolerance."""

    faults: list[dict[str, Any]] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    told: dict[str, Any] = field(default_factory=dict)


@dataclass
class Reading:
    """What sensors make of positions and torques, by joint."""

    zero: np.ndarray
    scale: np.ndarray
    offset: np.ndarray
    delay_s: np.ndarray


@dataclass(frozen=True)
class Reference:
    """Sums of sines about a middle, from rest."""

    f: np.ndarray
    size: np.ndarray
    phase: np.ndarray
    centre: np.ndarray

    @classmethod
    def of(cls, chain: list[Link], rng: np.random.Generator) -> Reference:
        J = len(chain)
        f = 0.07 + np.sort(rng.uniform(0.0, 0.7, (5, J)), axis=0)
        size, phase = rng.uniform(0.5, 1.0, (5, J)) / f, rng.uniform(0.0, 2.0 * np.pi, (5, J))
        most = np.array([rng.uniform(0.1, 0.25) if c.slides else rng.uniform(0.6, 1.1) for c in chain])
        return cls(f, size * most / size.sum(axis=0) * 1.4, phase, np.array([c.centre for c in chain]))

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w = 2.0 * np.pi * self.f
        angle = w * t[:, None, None] + self.phase
        s, c = self.size * np.sin(angle), self.size * np.cos(angle)
        x, x1, x2 = s.sum(axis=1), (w * c).sum(axis=1), -(w**2 * s).sum(axis=1)
        u = np.minimum(t / 2.0, 1.0)[:, None]
        e, e1 = u**3 * (10 - 15 * u + 6 * u**2), 15.0 * (u * (1 - u)) ** 2
        e2 = (60 * u - 180 * u**2 + 120 * u**3) / 4.0
        return self.centre + e * x, e * x1 + e1 * x, e * x2 + 2 * e1 * x1 + e2 * x


def sizes(spec: mujoco.MjSpec, reference: Reference) -> tuple[np.ndarray, ...]:
    """Root mean squares of torque, speed, acceleration, of torque per radian of a zero, and own inertia, shape (J,)."""
    model = spec.copy().compile()
    data, J = mujoco.MjData(model), model.nv
    x, x1, x2 = reference.at(np.arange(0.0, SECONDS, 0.05))
    torque, slope, inertia, full = np.zeros((len(x), J)), np.zeros((len(x), J, J)), np.zeros(J), np.zeros((J, J))
    for k in range(len(x)):
        for j in range(-1, J):
            data.qpos[:], data.qvel[:], data.qacc[:] = x[k] + 1e-4 * (np.arange(J) == j), x1[k], x2[k]
            mujoco.mj_inverse(model, data)
            if j < 0:
                torque[k] = data.qfrc_inverse
                mujoco.mj_fullM(model, data, full)
                inertia += np.diag(full) / len(x)
            else:
                slope[k, j] = (data.qfrc_inverse - torque[k]) / 1e-4
    rms = lambda z: np.sqrt(np.mean(z**2, axis=0))  # noqa: E731
    relative = np.max(rms(slope) / rms(torque), axis=1)
    return rms(torque), rms(x1), rms(x2), relative, inertia


def run(spec: mujoco.MjSpec, reference: Reference, law: np.ndarray | None, computed: bool) -> tuple[np.ndarray, ...]:
    """Positions and drive torques at every step; ``law``: foreign friction (5, J): dry, edge, excess, viscous, power."""
    model = spec.compile()
    data, J = mujoco.MjData(model), model.nv
    t = TIMESTEP_S * np.arange(round(SECONDS / TIMESTEP_S))
    x, x1, x2 = reference.at(t)
    data.qpos[:], data.qvel[:] = x[0], x1[0]
    mujoco.mj_forward(model, data)
    M = np.zeros((J, J))
    mujoco.mj_fullM(model, data, M)
    own, out = np.diag(np.diag(M)), np.empty((2, len(t), J))
    w = BANDWIDTH_PER_S if computed else 1.7 * BANDWIDTH_PER_S
    for k in range(len(t)):
        mujoco.mj_step1(model, data)
        if computed and k % 20 == 0:
            mujoco.mj_fullM(model, data, M)
        q, v = data.qpos, data.qvel
        wanted = 2.0 * w * (x1[k] - v) + w**2 * (x[k] - q)
        torque = (M @ (wanted + x2[k]) if computed else own @ wanted) + data.qfrc_bias
        out[0, k], out[1, k] = q, torque
        if law is not None:
            dry, edge, excess, viscous, power = law
            speed = np.abs(v)
            torque = torque - dry * np.tanh(v / edge) * (1.0 + excess * np.exp(-((speed / (6 * edge)) ** 2)))
            torque = torque - viscous * np.sign(v) * speed**power
        data.qfrc_applied[:] = torque
        mujoco.mj_step2(model, data)
    if not np.isfinite(out).all() or np.abs(out[0] - x).max() > 1.0:
        raise RuntimeError("the robot did not follow its reference")
    return t, out[0], out[1]


def logged(name: str, motion: tuple[np.ndarray, ...], reading: Reading, step: np.ndarray, noise: float,
           rng: np.random.Generator) -> JointLog:  # fmt: skip
    """What sensors read, at the log's rate; noise is a share of each torque's range."""
    t, q, torque = motion
    J, every = q.shape[1], round(1.0 / RATE_HZ / TIMESTEP_S)
    read = np.column_stack([np.interp(t - reading.delay_s[j], t, torque[:, j]) for j in range(J)])
    read = (read * reading.scale + reading.offset)[::every]
    read = read + noise * np.ptp(read, axis=0) * rng.standard_normal(read.shape)
    q = np.round((q + reading.zero)[::every] / step) * step
    none = np.full(J, np.nan)
    drive = Drive(np.ones(J), np.eye(J), np.ones(J), np.zeros(J, dtype=bool), "none", none, none, "torque",
                  np.full(J, np.inf))  # fmt: skip
    names = tuple(f"joint{j + 1}" for j in range(J))
    return JointLog(name, np.arange(len(q)) / RATE_HZ, RATE_HZ, q, read, None, None, names, drive, step,
                    np.ones(len(q), dtype=bool), RATE_HZ)  # fmt: skip


def thinned(log: JointLog, rate_hz: float) -> JointLog:
    """Every n-th sample."""
    n = round(log.rate_hz / rate_hz)
    return replace(log, time=log.time[::n], q=log.q[::n], torque=log.torque[::n], usable=log.usable[::n],
                   rate_hz=rate_hz, native_hz=rate_hz)  # fmt: skip


def _load(spec: mujoco.MjSpec, kg: float, rng: np.random.Generator, truth: Truth) -> None:
    """A box on the last link, axes along the link's."""
    link = spec.bodies[-1]
    box = link.add_body(name="load")
    box.mass, box.explicitinertial = kg, True
    box.pos = rng.uniform(-1.0, 1.0, 3) * [0.08, 0.08, 0.04] + np.asarray(link.ipos)
    a, b, c = rng.uniform(0.03, 0.07, 3) ** 2
    box.inertia = kg / 3.0 * np.array([b + c, a + c, a + b])
    truth.faults.append({"cause": "payload", "place": link.name, "size": kg})
    for label, value in zip(("m", "mx", "my", "mz"), (kg, *(kg * np.asarray(box.pos))), strict=True):
        truth.values[f"payload {link.name} {label}"] = float(value)


def make(part: str, seed: int, folder: Path) -> tuple[SerialModel, list[JointLog], Truth]:
    """A robot of a part of the campaign: its maker's model, logs of the true one, and what is hidden."""
    rng = np.random.default_rng([seed, *part.encode()])
    bare = part == "bare"
    shape = str(rng.choice(("ur", "industrial"))) if bare else SHAPES[seed % len(SHAPES)]
    chain = links(shape, rng)
    J, references = len(chain), []
    for _ in range(LOGS):
        references.append(Reference.of(chain, rng))
    inertia = sizes(spec_of(chain, np.zeros(J)), references[0])[4]
    rotor = rng.uniform(0.2, 0.8, J) * np.clip(inertia, 0.02, 2.0)
    maker = spec_of(chain, np.zeros(J) if bare else rotor)
    maker.compile()
    path = folder / f"{part}{seed}.xml"
    path.write_text(maker.to_xml(), encoding="utf-8")
    asks, speed, _, slope, inertia = sizes(maker, references[0])
    truth, true = Truth(told={"shape": shape}), maker.copy()
    off = rng.uniform(0.05, 0.1)
    for body in true.bodies[1:]:
        body.mass *= 1.0 + off * rng.uniform(-1.0, 1.0)
        body.fullinertia = np.asarray(body.fullinertia) * (1.0 + off * rng.uniform(-1.0, 1.0))
        body.ipos = np.asarray(body.ipos) * (1.0 + off * rng.uniform(-1.0, 1.0, 3))
    dry = rng.uniform(0.08, 0.35, J) * asks
    viscous = rng.uniform(0.05, 0.25, J) * asks / speed
    reading, law = Reading(np.zeros(J), np.ones(J), np.zeros(J), np.zeros(J)), None
    if bare:
        for j, joint in enumerate(true.joints):
            joint.frictionloss, joint.damping, joint.armature = dry[j], [viscous[j], 0.0, 0.0], rotor[j]
            joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
            n = joint.name
            truth.values |= {f"{n} coulomb_Nm": dry[j], f"{n} viscous_Nms_per_rad": viscous[j], f"{n} armature_kgm2": rotor[j]}
        truth.faults += [{"cause": c, "place": "all joints"} for c in ("friction", "armature")]
        if rng.random() < 0.5:
            _load(true, rng.uniform(0.5, 3.0), rng, truth)
        if rng.random() < 1.0 / 3.0:
            reading.delay_s[:] = rng.uniform(0.008, 0.02)
            truth.faults.append({"cause": "torque_delay", "place": "all joints", "size": reading.delay_s[0]})
            truth.values |= {f"joint{j + 1} delay_s": reading.delay_s[0] for j in range(J)}
    else:
        reading.zero, reading.scale = 1e-3 * rng.standard_normal(J), 1.0 + 0.01 * rng.standard_normal(J)
        reading.zero[[c.slides for c in chain]] *= 0.1
        edge = rng.uniform(0.01, 0.03, J) * np.where([c.slides for c in chain], 0.2, 1.0)
        dry = np.minimum(dry, 0.4 * edge * inertia / TIMESTEP_S)
        power = rng.uniform(0.5, 0.8, J)
        law = np.array([dry, edge, rng.uniform(0.0, 0.4, J), viscous * speed ** (1.0 - power), power])
        truth.told["foreign"] = True
    if part == "shapes":
        for cause in rng.choice(FAULTS, int(rng.integers(1, 4)), replace=False):
            _fault(str(cause), true, reading, (chain, asks, slope, inertia), rng, truth)
    computed, noise = bool(rng.random() < 0.5), float(rng.uniform(0.003, 0.02))
    step = np.where([c.slides for c in chain], 5e-6, 2.0 * np.pi / 2.0 ** rng.integers(16, 20))
    truth.told |= {"computed_torque": computed, "noise": noise, "joints": J}
    logs = [logged(f"log {k + 1}", run(true.copy(), r, law, computed), reading, step, noise, rng)
            for k, r in enumerate(references)]  # fmt: skip
    return load_model(path), logs, truth


def _fault(cause: str, true: mujoco.MjSpec, reading: Reading, about: tuple, rng: np.random.Generator, truth: Truth) -> None:
    """One fault at a random joint where it shows."""
    chain, asks, slope, inertia = about
    j = int(rng.integers(len(chain)))
    joint = true.joint(f"joint{j + 1}")
    size = 0.0
    if cause == "payload":
        total = sum(c.mass for c in chain)
        _load(true, float(np.clip(rng.uniform(0.05, 0.12) * total, 0.5, 3.0)), rng, truth)
        return
    if cause == "armature":
        size = rng.uniform(0.25, 0.6) * inertia[j]
        joint.armature += size
    elif cause == "torque_scale":
        size = 0.15 * rng.choice([-1.0, 1.0])
        reading.scale[j] *= 1.0 + size
    elif cause == "spring":
        size = rng.uniform(0.3, 0.6) * asks[j] / (0.1 if chain[j].slides else 0.4)
        joint.stiffness, joint.springref = [size, 0.0, 0.0], chain[j].centre
    elif cause == "joint_zero":
        j = int(rng.choice(np.argsort([s if not c.slides else 0.0 for s, c in zip(slope, chain, strict=True)])[-2:]))
        size = 0.03 * rng.choice([-1.0, 1.0])
        reading.zero[j] += size
        truth.told["zero_shows"] = float(slope[j] * 0.03)
    elif cause == "torque_offset":
        size = rng.uniform(0.2, 0.4) * asks[j] * rng.choice([-1.0, 1.0])
        reading.offset[j] += size
    else:
        size = 0.01
        reading.delay_s[j] += size
    truth.faults.append({"cause": cause, "place": f"joint{j + 1}", "size": float(size)})
