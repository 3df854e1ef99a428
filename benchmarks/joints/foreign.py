"""Robots that no table was made for: a maker's model, what the true one has besides, and its logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from discrepancy.joints.model import SerialModel, load_model
from mocobot_logs.joints.joint_log import Drive, JointLog

TIMESTEP_S, RATE_HZ, SECONDS, LOGS, BANDWIDTH_PER_S = 5e-4, 1000.0, 30.0, 2, 15.0
CHAINS = ("chain3", "chain4", "chain5", "chain6", "chain7")
SHAPES = ("scara", "gantry", "leg", "rail", *CHAINS, "ur", "industrial")
FAULTS = ("payload", "armature", "torque_scale", "spring", "joint_zero", "torque_offset", "torque_delay")
X, Y, Z = np.eye(3)
Row, Item, Series = tuple[Any, ...], dict[str, Any], tuple[np.ndarray, ...]
"""A link: axis of its joint, where it ends [m], mass [kg], middle of its motion, whether it slides."""


def links(shape: str, rng: np.random.Generator) -> list[Row]:
    """A robot of a shape, with random lengths and masses."""
    a, b, c = rng.uniform((0.3, 0.25, 0.06), (0.6, 0.55, 0.12))
    m = np.sort(rng.uniform(1.0, 15.0 if shape in ("ur", "industrial") else 8.0, 7))[::-1]
    rows: dict[str, list[Row]] = {
        "ur": [(Z, (0, 0.13, 0), m[1], 0, 0), (Y, (a, -0.1, 0), m[0], -0.9, 0), (Y, (b, 0, 0), m[2], 1.2, 0),
               (Y, (0, c, 0), m[3], -0.5, 0), (Z, (0, 0, -c), m[4], 0.4, 0), (Y, (0, c, 0), m[5], 0, 0)],
        "industrial": [(Z, (c + 0.1, 0, 0.1), m[0], 0, 0), (Y, (0, 0, a), m[1], 0.2, 0),
                       (Y, (0.1, 0, 0.08), m[2], -0.1, 0), (X, (b, 0, 0), m[3], 0, 0),
                       (Y, (c, 0, 0), m[4], 0.6, 0), (X, (0.03, 0.01, 0), m[5], 0, 0)],
        "scara": [(Z, (a, 0, 0), m[0], 0, 0), (Z, (b, 0, 0), m[1], 0.8, 0), (Z, (0, 0, -0.2), m[4], 0, 1),
                  (Z, (0.04, 0, -0.03), m[6], 0, 0)],
        "gantry": [(X, (0, 0.4, 0), 2 * m[0], 0, 1), (Y, (0.1, 0, 0), m[1], 0, 1), (Z, (0, 0, -0.4), m[3], 0, 1),
                   (Z, (0.03, 0, -0.1), m[5], 0, 0), (Y, (0.05, 0, -0.15), m[6], 0.2, 0)],
        "leg": [(X, (0, 0.1, 0), m[1], 0, 0), (Y, (0, 0, -a), m[0], -0.6, 0), (Y, (0, 0, -b), m[3], 1.2, 0),
                (Y, (0.15, 0, -0.03), m[5], -0.5, 0)],
        "rail": [(Y, (0, 0.1, 0.1), 2 * m[0], 0, 1)],
    }  # fmt: skip
    out = rows.get(shape, [])
    for k in range(4 if shape == "rail" else int(shape[-1]) if shape not in rows else 0):
        choice = [x for x in (X, Y, Z) if k and (x is not out[-1][0] or rng.random() < 0.3)] or [Z]
        way = rng.standard_normal(3) * [1.0, 0.4, 0.7]
        end = rng.uniform(0.12, 0.4) * way / np.linalg.norm(way)
        out.append((choice[int(rng.integers(len(choice)))], end, m[k], rng.uniform(-0.8, 0.8), 0))
    return out


def spec_of(chain: list[Row], rotor: np.ndarray) -> mujoco.MjSpec:
    """The maker's model: rods, with rotors but no friction."""
    spec, at = mujoco.MjSpec(), np.array([0.0, 0.0, 0.3])
    body = spec.worldbody
    for k, (axis, end, mass, _, slides) in enumerate(chain):
        body, at = body.add_body(name=f"link{k + 1}", pos=at), np.asarray(end, dtype=float)
        length = float(np.linalg.norm(at))
        rod, own = at / length, mass * 0.05**2 / 2
        body.mass, body.explicitinertial = mass, True
        body.ipos = 0.45 * at + 0.02 * np.cross(rod, [0.31, 0.57, 0.76])
        full = own * np.eye(3) + mass * length**2 / 12 * (np.eye(3) - np.outer(rod, rod))
        body.fullinertia = full[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name=f"joint{k + 1}", type=kind, axis=axis, armature=rotor[k])
    spec.option.timestep, spec.option.integrator = TIMESTEP_S, mujoco.mjtIntegrator.mjINT_EULER
    return spec


def reference(chain: list[Row], rng: np.random.Generator) -> Series:
    """Time, positions, velocities and accelerations: sums of sines about a middle, from rest."""
    J = len(chain)
    f = 0.07 + np.sort(rng.uniform(0.0, 0.7, (5, J)), axis=0)
    size, phase = rng.uniform(0.5, 1.0, (5, J)) / f, rng.uniform(0.0, 2.0 * np.pi, (5, J))
    size *= [rng.uniform(0.15, 0.35) if c[4] else rng.uniform(0.8, 1.5) for c in chain] / size.sum(axis=0)
    t, w = TIMESTEP_S * np.arange(round(SECONDS / TIMESTEP_S)), 2.0 * np.pi * f
    turn = np.exp(1j * (w * t[:, None, None] + phase)) * size
    x, x1, x2 = ((turn * (1j * w) ** n).imag.sum(axis=1) for n in range(3))
    u = np.minimum(t / 2.0, 1.0)[:, None]
    e, e1 = u**3 * (10 - 15 * u + 6 * u**2), 15.0 * (u * (1 - u)) ** 2
    e2 = (60 * u - 180 * u**2 + 120 * u**3) / 4.0
    return t, [c[3] for c in chain] + e * x, e * x1 + e1 * x, e * x2 + 2 * e1 * x1 + e2 * x


def sizes(spec: mujoco.MjSpec, path: Series) -> Series:
    """Root mean squares of torque and speed, the most that a zero of one radian changes of them, own inertia, (J,)."""
    model = spec.copy().compile()
    data, J = mujoco.MjData(model), model.nv
    _, x, x1, x2 = (p[::100] for p in path)
    torque, inertia, full = np.zeros((J + 1, len(x), J)), np.zeros(J), np.zeros((J, J))
    for k in range(len(x)):
        for j in range(J + 1):
            data.qpos[:], data.qvel[:], data.qacc[:] = x[k] + 1e-4 * (np.arange(J) == j), x1[k], x2[k]
            mujoco.mj_inverse(model, data)
            torque[j, k] = data.qfrc_inverse
        mujoco.mj_fullM(model, data, full)
        inertia += np.diag(full) / len(x)
    rms = np.sqrt(np.mean(torque[J] ** 2, axis=0))
    changed = np.sqrt(np.mean((torque[:J] - torque[J]) ** 2, axis=1)) / 1e-4
    return rms, np.sqrt(np.mean(x1**2, axis=0)), np.max(changed / rms, axis=1), inertia


def run(spec: mujoco.MjSpec, path: Series, law: np.ndarray, computed: bool) -> np.ndarray:
    """Positions and drive torques at every step; ``law``: foreign friction (dry, edge, excess, viscous, power)."""
    model = spec.compile()
    data, J = mujoco.MjData(model), model.nv
    t, x, x1, x2 = path
    dry, edge, excess, viscous, power = law
    data.qpos[:], data.qvel[:] = x[0], x1[0]
    mujoco.mj_forward(model, data)
    M, out = np.zeros((J, J)), np.empty((2, len(t), J))
    mujoco.mj_fullM(model, data, M)
    own, w = np.diag(np.diag(M)), BANDWIDTH_PER_S * (1.0 if computed else 1.7)
    for k in range(len(t)):
        mujoco.mj_step1(model, data)
        if computed and k % 20 == 0:
            mujoco.mj_fullM(model, data, M)
        q, v = data.qpos, data.qvel
        wanted = 2.0 * w * (x1[k] - v) + w**2 * (x[k] - q)
        torque = (M @ (wanted + x2[k]) if computed else own @ wanted) + data.qfrc_bias
        out[0, k], out[1, k] = q, torque
        speed = np.abs(v)
        torque = torque - dry * np.tanh(v / edge) * (1.0 + excess * np.exp(-((speed / (6 * edge)) ** 2)))
        torque = torque - viscous * np.sign(v) * speed**power
        data.qfrc_applied[:] = torque
        mujoco.mj_step2(model, data)
    if not np.isfinite(out).all() or np.abs(out[0] - x).max() > 1.0:
        raise RuntimeError("the robot did not follow its reference")
    return out


def logged(name: str, t: np.ndarray, motion: np.ndarray, reads: np.ndarray, step: np.ndarray, noise: float,
           rng: np.random.Generator) -> JointLog:  # fmt: skip
    """What sensors read; ``reads`` (4, J): zero, scale, offset, delay; noise is a share of each torque's range."""
    (q, torque), (zero, scale, offset, late) = motion, reads
    J, every = q.shape[1], round(1.0 / RATE_HZ / TIMESTEP_S)
    read = np.column_stack([np.interp(t - late[j], t, torque[:, j]) for j in range(J)])
    read = (read * scale + offset)[::every]
    read = read + noise * np.ptp(read, axis=0) * rng.standard_normal(read.shape)
    q, none = np.round((q + zero)[::every] / step) * step, np.full(J, np.nan)
    drive = Drive(np.ones(J), np.eye(J), np.ones(J), np.zeros(J, dtype=bool), "none", none, none, "torque",
                  np.full(J, np.inf))  # fmt: skip
    names, usable = tuple(f"joint{j + 1}" for j in range(J)), np.ones(len(q), dtype=bool)
    t = np.arange(len(q)) / RATE_HZ
    return JointLog(name, t, RATE_HZ, q, read, None, None, names, drive, step, usable, RATE_HZ)


def thinned(log: JointLog) -> JointLog:
    """A log of a quarter of the samples."""
    return replace(log, time=log.time[::4], q=log.q[::4], torque=log.torque[::4], usable=log.usable[::4],
                   rate_hz=RATE_HZ / 4, native_hz=RATE_HZ / 4)  # fmt: skip


def make(part: str, seed: int, folder: Path) -> tuple[SerialModel, list[JointLog], Item]:
    """A robot of a part of the campaign: its maker's model, logs of the true one, and what is hidden."""
    rng = np.random.default_rng([seed, *part.encode()])
    shape = SHAPES[seed % len(SHAPES)]
    chain = links(shape, rng)
    J, slides = len(chain), np.array([bool(c[4]) for c in chain])
    paths = [reference(chain, rng) for _ in range(LOGS)]
    rotor = rng.uniform(0.2, 0.8, J) * np.clip(sizes(spec_of(chain, np.zeros(J)), paths[0])[3], 0.02, 2.0)
    maker = spec_of(chain, rotor)
    maker.compile()
    (folder / f"{part}{seed}.xml").write_text(maker.to_xml(), encoding="utf-8")
    asks, speed, slope, inertia = sizes(maker, paths[0])
    true, off, faults = maker.copy(), rng.uniform(0.05, 0.1), []
    for body in true.bodies[1:]:
        body.mass *= 1.0 + off * rng.uniform(-1.0, 1.0)
        body.fullinertia = np.asarray(body.fullinertia) * (1.0 + off * rng.uniform(-1.0, 1.0))
        body.ipos = np.asarray(body.ipos) * (1.0 + off * rng.uniform(-1.0, 1.0, 3))
    dry, viscous = rng.uniform(0.08, 0.35, J) * asks, rng.uniform(0.05, 0.25, J) * asks / speed
    reads = np.array([np.zeros(J), np.ones(J), np.zeros(J), np.zeros(J)])
    reads[0] = 1e-3 * rng.standard_normal(J) * np.where(slides, 0.1, 1.0)
    reads[1] += 0.01 * rng.standard_normal(J)
    edge, power = rng.uniform(0.01, 0.03, J) * np.where(slides, 0.2, 1.0), rng.uniform(0.5, 0.8, J)
    dry = np.minimum(dry, 0.4 * edge * inertia / TIMESTEP_S)
    law = np.array([dry, edge, rng.uniform(0.0, 0.4, J), viscous * speed ** (1.0 - power), power])
    for cause in rng.choice(FAULTS, int(rng.integers(1, 4)), replace=False) if part == "shapes" else ():
        if cause == "payload":
            kg = float(np.clip(rng.uniform(0.05, 0.12) * sum(c[2] for c in chain), 0.5, 3.0))
            faults.append(_load(true, kg, rng))
        else:
            # A zero where it shows most; a scale not at the first joint, where it is the link's inertia; one each.
            shows = {
                "joint_zero": [k for k in np.argsort(slope * ~slides)[-3:] if not slides[k]],
                "torque_scale": np.arange(1, J),
            }
            taken = {f["place"] for f in faults}
            j = int(rng.choice([k for k in shows.get(cause, range(J)) if f"joint{k + 1}" not in taken]))
            faults.append(_fault(str(cause), j, (true, reads), (chain[j], asks[j], inertia[j]), rng))
    computed, noise = bool(rng.random() < 0.5), float(rng.uniform(0.003, 0.02))
    step = np.where(slides, 5e-6, 2.0 * np.pi / 2.0 ** rng.integers(16, 20))
    truth = {"shape": shape, "joints": J, "computed_torque": computed, "noise": round(noise, 4), "foreign": True,
             "faults": faults}  # fmt: skip
    logs = [thinned(logged(f"log {k + 1}", p[0], run(true.copy(), p, law, computed), reads, step, noise, rng))
            for k, p in enumerate(paths)]  # fmt: skip
    return load_model(folder / f"{part}{seed}.xml"), logs, truth


def _load(spec: mujoco.MjSpec, kg: float, rng: np.random.Generator) -> Item:
    """A box on the last link, axes along the link's."""
    link = spec.bodies[-1]
    box, (a, b, c) = link.add_body(name="load"), rng.uniform(0.03, 0.07, 3) ** 2
    box.ipos = [0.0, 0.0, 0.0]  # else MuJoCo puts the centre of mass at twice the box's position
    box.mass, box.explicitinertial, box.inertia = kg, True, kg / 3.0 * np.array([b + c, a + c, a + b])
    box.pos = rng.uniform(-1.0, 1.0, 3) * [0.08, 0.08, 0.04] + np.asarray(link.ipos)
    return {"cause": "payload", "place": link.name, "size": kg}


def _fault(
    cause: str, j: int, robot: tuple[mujoco.MjSpec, np.ndarray], about: Row, rng: np.random.Generator
) -> Item:
    """One fault at a joint."""
    (true, reads), (row, asks, inertia) = robot, about
    joint, side = true.joint(f"joint{j + 1}"), float(rng.choice([-1.0, 1.0]))
    size = {"armature": rng.uniform(0.25, 0.6) * inertia, "torque_scale": 0.15 * side, "joint_zero": 0.03 * side,
            "spring": rng.uniform(0.3, 0.6) * asks / (0.1 if row[4] else 0.4),
            "torque_offset": rng.uniform(0.2, 0.4) * asks * side, "torque_delay": 0.01}[cause]  # fmt: skip
    if cause == "armature":
        joint.armature += size
    elif cause == "spring":
        joint.stiffness, joint.springref = [size, 0.0, 0.0], row[3]
    else:
        reads[("joint_zero", "torque_scale", "torque_offset", "torque_delay").index(cause), j] += size
    return {"cause": cause, "place": f"joint{j + 1}", "size": float(size)}
