"""Signals of logs, and the linear problem that they make."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.posterior import Group
from discrepancy.joints.causes import CAUSES, JointSignals, Span
from discrepancy.serial.causes.elasticity import along
from discrepancy.serial.mechanics.motion import Motion
from discrepancy.serial.mechanics.nominal import inverse_torque
from discrepancy.serial.mechanics.regressor import body_regressor, inertial_parameters, torque_of
from discrepancy.serial.mechanics.shift import by_acceleration, by_displacement
from discrepancy.serial.mechanics.tree import Tree
from discrepancy.serial.model import SerialModel
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass

FORM = 0.05
EDGES = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 3.5, 5.0, 7.0, 10.0])


@dataclass(eq=False)
class Built:
    cells: Cells
    labels: list[str]
    tolerance: list[float]
    groups: dict[str, Group] = field(default_factory=dict)
    reversals: dict[int, list[int]] = field(default_factory=dict)
    reversals_mean: dict[int, list[int]] = field(default_factory=dict)
    traces: dict[int, Mapping[int, Sequence[Array]]] = field(default_factory=dict)
    joints: list[list[JointSignals]] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    loss: Array = field(default_factory=lambda: np.zeros(0))
    series: list = field(default_factory=list)

    @property
    def prior(self) -> Array:
        return np.array(self.tolerance) ** 2


def signals_of(model: SerialModel, logs) -> list[Signals]:
    tree = Tree.of(model.model)
    from functools import partial

    parts = [Signals.of(log, tree, partial(inverse_torque, model.model)) for log in logs]
    square = [np.mean(s.dq**2, axis=0) for s in parts]
    typical = np.maximum(np.sqrt(np.mean(square, axis=0)), 1e-6)
    return [replace(s, typical=typical) for s in parts]


def modelled_forms(signals, coulomb: float, viscous: float):
    """How the friction that a model names may differ from its law: name, standard deviation, series."""
    from discrepancy.joints.causes import _bent
    from discrepancy.joints.forms import smooth
    for bristle in (1e-3, 4e-3):
        yield f"bent {bristle}", 0.3 * coulomb, [_bent(s, bristle) - s.direction for s in signals]
    for share in (0.03, 0.1):
        yield f"slow {share}", 0.1 * coulomb, [s.direction * np.exp(-np.abs(s.v) / (share * s.speed)) for s in signals]
    yield "lag", 1e-3 * coulomb, [np.gradient(s.direction, s.dt) for s in signals]
    each = [smooth(s) for s in signals]
    trace = [coulomb * s.direction + viscous * s.v for s in signals]
    for i in range(len(each[0])):
        yield f"smooth {i}", FORM, [e * b[i] for e, b in zip(trace, each, strict=True)]


REST = 1.5


def rests(v: Array, dt: float, slow: float) -> list[tuple[int, int]]:
    """Samples of each interval in which a joint may rest or turn round: first, and one past the last."""
    turns = (v[1:] > 0) != (v[:-1] > 0)
    still = (np.abs(v) < slow) | np.append(turns, False) | np.append(False, turns)
    at = np.flatnonzero(still)
    if not len(at):
        return []
    parts = np.split(at, np.flatnonzero(np.diff(at) > 0.025 / dt) + 1)
    return [(max(int(p[0]) - 1, 0), min(int(p[-1]) + 2, len(v))) for p in parts]


def direction_of(v: Array, dt: float, slow: float) -> Array:
    """Direction of motion; where a joint rests, on the straight line between those before and after."""
    out = np.sign(v)
    for a, b in rests(v, dt, slow):
        before, after = (out[a - 1] if a else 0.0), (out[b] if b < len(v) else 0.0)
        out[a:b] = before + (after - before) * (np.arange(b - a) + 0.5) / (b - a)
    return out


def build(model: SerialModel, parts: list[Signals], values: Mapping[str, float] | None = None, friction: Array | None = None) -> Built:
    """``values``: tolerances by label around which to linearise; ``friction``: dry friction that was found by joint."""
    values = values or {}
    tree0 = parts[0].tree
    J = len(model.joints)
    names = model.joints
    cut = [slice(math.ceil(0.1 * s.rate_hz), len(s.time) - math.ceil(0.1 * s.rate_hz)) for s in parts]
    # --- the tree and zeros at the values
    tree = _at(tree0, model, values)
    zero = np.array([values.get(f"{n} zero", 0.0) for n in names])
    moved = []
    for s in parts:
        q = s.q + zero
        inverse = s.inverse if not values else torque_of(tree, q, s.dq, s.ddq) + tree0.armature * s.ddq
        moved.append(replace(s, tree=tree, q=q, inverse=inverse))
    parts = moved
    if not values:  # against MuJoCo's
        pass
    slow = parts[0].slow
    spans = []
    every = lambda f: np.concatenate([f(s)[c] for s, c in zip(parts, cut, strict=True)])
    T, V, A, Q = every(lambda s: s.torque), every(lambda s: s.dq), every(lambda s: s.ddq), every(lambda s: s.q)
    for j in range(J):
        spans.append(Span(float(np.sqrt(np.mean(T[:, j] ** 2))) + 1e-9, float(np.sqrt(np.mean(V[:, j] ** 2))) + 1e-9,
                          float(np.sqrt(np.mean(A[:, j] ** 2))) + 1e-9, float(np.ptp(Q[:, j])) + 1e-9))
    until = max(float(s.time[-1]) for s in parts)
    joints: list[list[JointSignals]] = [[] for _ in range(J)]
    residual = []
    for s, c in zip(parts, cut, strict=True):
        direction = np.column_stack([direction_of(s.dq[:, j], 1.0 / s.rate_hz, REST * slow[j]) for j in range(J)])
        scale = np.array([values.get(f"{n} scale", 0.0) for n in names])
        delay = np.array([values.get(f"{n} delay", 0.0) for n in names])
        torque = s.torque
        asked = s.inverse + tree0.coulomb * direction + tree0.viscous * s.dq
        dt = 1.0 / s.rate_hz
        if values:
            from scipy.interpolate import CubicSpline
            torque = np.column_stack([CubicSpline(s.time, s.torque[:, j])(np.clip(s.time + delay[j], s.time[0], s.time[-1])) if delay[j] else s.torque[:, j] for j in range(J)])
        rotor = np.array([values.get(f"{n} rotor", 0.0) for n in names]); co = np.array([values.get(f"{n} Coulomb", 0.0) for n in names]); vi = np.array([values.get(f"{n} viscous", 0.0) for n in names])
        full = asked + rotor * s.ddq + co * direction + vi * s.dq
        residual.append((torque - full * (1.0 + scale))[c])
        for j in range(J):
            joints[j].append(JointSignals(s.q[c, j], s.dq[c, j], s.ddq[c, j], direction[c, j], s.inverse[c, j], full[c, j], torque[c, j], s.time[c], dt,
                                          spans[j].travel, float(0.5 * (Q[:, j].max() + Q[:, j].min())), spans[j].speed, until))
    bands = Bands([s.rate_hz for s in parts], [len(r) for r in residual], EDGES)
    cells = Cells.of(bands, residual)
    B = Built(cells, [], [], loss=tree0.coulomb, joints=joints, spans=spans)
    series: list[dict[int, list[Array]]] = []

    def add(label: str, tolerance: float, by: dict[int, list[Array]]) -> int:
        series.append(by); B.labels.append(label); B.tolerance.append(tolerance)
        return len(B.labels) - 1

    def wide(f) -> dict[int, list[Array]]:
        done = [f(s)[c] for s, c in zip(parts, cut, strict=True)]
        return {j: [d[:, j] for d in done] for j in range(J) if any(np.abs(d[:, j]).max() > 0 for d in done)}

    own: dict[tuple[int, str], int] = {}
    tol = {}
    for j in range(J):
        n = names[j]
        tol[f"{n} coulomb_Nm"] = 0.03 * tree0.coulomb[j]; tol[f"{n} viscous_Nms_per_rad"] = 0.03 * tree0.viscous[j]
        tol[f"{n} armature_kgm2"] = 0.03 * tree0.armature[j]; tol[f"{n} scale0.0"] = 0.02; tol[f"{n} delay_s"] = 5e-4
    alias = {"coulomb_Nm": "Coulomb", "viscous_Nms_per_rad": "viscous", "armature_kgm2": "rotor", "delay_s": "delay"}
    for j in range(J):
        n = names[j]
        for cause in CAUSES:
            for shape in cause.shapes:
                cols = [cause.columns(s, shape) for s in joints[j]]
                idx = []
                for k, p in enumerate(cause.parameters):
                    plain = p in ("coulomb_Nm", "viscous_Nms_per_rad", "offset_Nm") and not (p == "coulomb_Nm" and shape)
                    if cause.name == "warming": plain = False
                    if plain and (j, p) in own:
                        idx.append(own[j, p]); continue
                    label = f"{n} {alias.get(p, p)}" if not shape else f"{n} {cause.name} {p} {dict(shape)}"
                    t = 0.0
                    if cause.name == "torque_scale" and shape["bend"] == 0.0: label, t = f"{n} scale", 0.02
                    elif not shape: t = tol.get(f"{n} {p}", 0.0) if cause.name in ("friction", "armature", "torque_delay") else 0.0
                    elif cause.name == "friction" and p == "coulomb_Nm": t = 0.0
                    
                    i = add(label, t, {j: [c[k] for c in cols]})
                    if plain: own[j, p] = i
                    idx.append(i)
                name = f"{cause.name} {n} {dict(shape) if shape else ''}".strip()
                B.groups[name] = Group(name, cause.name, n, tuple(idx), tuple(cause.slab(spans[j], shape)), -math.log(len(cause.shapes)))
        if tree0.coulomb[j] or tree0.viscous[j]:
            for what, share, cols in modelled_forms(joints[j], float(tree0.coulomb[j]), float(tree0.viscous[j])):
                add(f"{n} form {what}", share, {j: cols})
    # --- of all joints: zeros, tilt, lengths, inertias
    for j in range(1, J):
        n = names[j]
        def f(s, j=j):
            way = np.ones(len(s.time)); return along(s, j, way) 
        i = add(f"{n} zero", 2e-3, wide(f))
        B.groups[f"joint_zero {n}"] = Group(f"joint_zero {n}", "joint_zero", n, (i,), (0.1,))
    for j in range(J):
        n = names[j]
        def f(s, j=j):
            load = low_pass(s.inverse[:, j], s.rate_hz, 7.0); return along(s, j, -load)
        i = add(f"{n} compliance", 0.0, wide(f))
        B.groups[f"elasticity {n}"] = Group(f"elasticity {n}", "elasticity", n, (i,), (1e-3,), 0.0, (0.0,))
    for j in range(1, J):
        n = names[j]; p = j - 1
        for sign in (1.0, -1.0):
            cols = {j: [[], [], []], p: [[], [], []]}
            for s, c in zip(parts, cut, strict=True):
                v, a = s.dq[c, j] + sign * s.dq[c, p], s.ddq[c, j] + sign * s.ddq[c, p]
                d = direction_of(v, 1.0 / s.rate_hz, REST * (slow[j] + slow[p]))
                for k, x in enumerate((d, v, a)):
                    cols[j][k].append(x); cols[p][k].append(sign * x)
            idx = tuple(add(f"{n} pair{sign:+.0f} {w}", 0.0, {j: cols[j][k], p: cols[p][k]}) for k, w in enumerate(("dry", "viscous", "rotor")))
            z = spans[j]
            B.groups[f"coupled_drive {n} {sign:+.0f}"] = Group(f"coupled_drive {n} {sign:+.0f}", "coupled_drive", n, idx, (z.torque, z.torque / z.speed, z.torque / z.acceleration), -math.log(2))
    acc = {id(s): by_acceleration(s.motion) for s in parts}
    g = tree.gravity
    ax = np.linalg.svd(g[None] / np.linalg.norm(g))[2][1:]
    k = [add(f"tilt {i}", 5e-3, wide(lambda s, w=w: acc[id(s)] @ np.cross(w, g))) for i, w in enumerate(ax)]
    B.groups["gravity_direction"] = Group("gravity_direction", "gravity_direction", "arm", tuple(k), (0.1, 0.1))
    k = [add("gravity share", 0.0, wide(lambda s: acc[id(s)] @ g))]
    B.groups["gravity_compensation"] = Group("gravity_compensation", "gravity_compensation", "arm", tuple(k), (0.5,))
    for j in range(1, J):
        body = int(tree.joint_body[j])
        cols = {id(s): by_displacement(s.motion, body) for s in parts}
        k = [add(f"{names[j]} length {'xyz'[x]}", 1e-3, wide(lambda s, x=x: cols[id(s)][:, :, x])) for x in range(3)]
        B.groups[f"link_length {names[j]}"] = Group(f"link_length {names[j]}", "link_length", names[j], tuple(k), (0.02,) * 3)
    for body in tree.links:
        n = model.model.body(int(body)).name
        Y = {id(s): body_regressor(s.motion, int(body)) for s in parts}
        m, c0, I0 = tree0.mass[body], tree0.com[body], tree0.inertia[body]
        mt, ct = tree.mass[body], tree.com[body]
        par = inertial_parameters
        d_m = par(m, ct, np.zeros((3, 3)))
        k = add(f"{n} mass share", 0.1, wide(lambda s: Y[id(s)] @ d_m))
        B.groups[f"link_mass {n}"] = Group(f"link_mass {n}", "link_mass", n, (k,), (1.0,))
        kc = []
        for x in range(3):
            e = 1e-4 * np.eye(3)[x]
            d = (par(mt, ct + e, np.zeros((3, 3))) - par(mt, ct, np.zeros((3, 3)))) / 1e-4
            kc.append(add(f"{n} com {'xyz'[x]}", 0.1 * max(abs(c0[x]), 0.01), wide(lambda s, d=d: Y[id(s)] @ d)))
        B.groups[f"link_com {n}"] = Group(f"link_com {n}", "link_com", n, tuple(kc), (0.1,) * 3)
        dI = par(0.0, np.zeros(3), I0)
        k = add(f"{n} inertia share", 0.1, wide(lambda s: Y[id(s)] @ dI))
        B.groups[f"link_inertia {n}"] = Group(f"link_inertia {n}", "link_inertia", n, (k,), (2.0,))
        if body == tree.links[-1]:
            r = 0.15
            kp = [add(f"payload {n} {l}", 0.0, wide(lambda s, i=i: Y[id(s)][:, :, i])) for i, l in enumerate("m mx my mz xx yy zz xy xz yz".split())]
            B.groups[f"payload {n}"] = Group(f"payload {n}", "payload", n, tuple(kp), tuple(np.array([1, r, r, r] + [r * r / 2] * 6) * 2.0))
    # --- reversals: one random instant each
    noise_v = [np.sqrt(np.mean((s.dq - low_pass(s.dq, s.rate_hz, 15.0)) ** 2, axis=0)) for s in parts]
    dry = np.abs(tree0.coulomb) + (0.0 if friction is None else np.abs(friction))
    for j in range(J):
        B.reversals[j] = []
        common = [[np.zeros(len(o.v)) for o in joints[j]] for _ in range(3)]
        for t, s in enumerate(joints[j]):
            for a, b in rests(s.v, s.dt, REST * slow[j]):
                n = b - a
                place = (np.arange(n) + 0.5) / n
                before, after = (np.sign(s.v[a - 1]) if a else 0.0), (np.sign(s.v[b]) if b < len(s.v) else 0.0)
                for k in range(3):
                    common[k][t][a:b] = 0.5 * (after - before) * np.cos(np.pi * k * place)
                for k in range(1 + min(int(n * s.dt / 0.06), 12)):
                    x = [np.zeros(len(o.v)) for o in joints[j]]
                    x[t][a:b] = np.cos(np.pi * k * place)
                    B.reversals[j].append(add(f"{names[j]} reversal {t} {a} {k}", dry[j] / np.sqrt(3.0) / (1 + k), {j: x}))
        for k in range(3):
            B.reversals_mean.setdefault(j, []).append(add(f"{names[j]} turning {k}", 0.5 * dry[j], {j: common[k]}))
    # The columns' values count from the model, not from where they are linear.
    for i, label in enumerate(B.labels):
        if values.get(label):
            for c, x in series[i].items():
                for t, own in enumerate(x):
                    residual[t][:, c] += values[label] * own
    B.cells = cells = Cells.of(bands, residual)
    cells.add(series)
    B.series = series
    return B


def _at(tree: Tree, model: SerialModel, values: Mapping[str, float]) -> Tree:
    if not values:
        return tree
    mass, com, inertia, position, gravity = tree.mass.copy(), tree.com.copy(), tree.inertia.copy(), tree.position.copy(), tree.gravity.copy()
    for b in tree.links:
        n = model.model.body(int(b)).name
        mass[b] *= max(1.0 + values.get(f"{n} mass share", 0.0), 0.05)
        com[b] += [values.get(f"{n} com {x}", 0.0) for x in "xyz"]
        inertia[b] *= max(1.0 + values.get(f"{n} inertia share", 0.0), 0.05)
    for j, n in enumerate(model.joints):
        position[tree.joint_body[j]] += [values.get(f"{n} length {x}", 0.0) for x in "xyz"]
    g = gravity
    ax = np.linalg.svd(g[None] / np.linalg.norm(g))[2][1:]
    # The columns count gravity's change as +w x g with the torque of an acceleration.
    for i, w in enumerate(ax):
        gravity = gravity - values.get(f"tilt {i}", 0.0) * np.cross(w, g)
    return replace(tree, mass=mass, com=com, inertia=inertia, position=position, gravity=gravity)
