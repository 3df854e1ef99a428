"""Build the linear problem of a robot's joint logs around given values: regressor columns, priors, residual torques."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from discrepancy.evidence.cells import Bands, Cells, Series
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.search import Chosen
from discrepancy.joints import backlash, friction
from discrepancy.joints.causes import CAUSES, JointSignals, Span
from discrepancy.joints.closed_loop import ClosedLoop, bands_of
from discrepancy.joints.loop_filter import Filtered
from discrepancy.joints.mechanics import (
    Tree,
    body_regressor,
    by_acceleration,
    by_displacement,
    force_torque,
    inertial_parameters,
    rigid_torque,
    torque_of,
    with_load,
)
from discrepancy.joints.model import SerialModel
from discrepancy.joints.mount import gravity_at, ways
from discrepancy.joints.pushes import Pushes
from discrepancy.joints.signals import REST, Signals, along
from discrepancy.joints.stand import Stand
from discrepancy.joints.unlisted import SIGNALS, SIZES, functions
from estimator.arrays import Array
from estimator.filtering import low_pass


@dataclass(frozen=True)
class Given:
    """Options of a linear problem.

    Attributes:
        changed: number of leading signals in which causes act; the others are a reference. None: all.
        joints: indices of the joints with torques, from 0; None: all.
        motors: joints whose torque per unit of the logged signal is identified with the model.
        back_emf: joints whose drives lose torque in proportion to speed while they are on.
        excluded: causes to leave out.
        tolerances: prior standard deviations by cause and parameter that replace the defaults.
        noise: one sample of the sensor noise in the residual for each log, shape (W, J) each; None: unknown.
        kept: weight of each sample, shape (W, J) for each log; empty: all samples count.
        inertias: whether every link has a column for each of its ten inertial parameters.
        mount: gravity of another mount of the base than the model's [m/s^2], shape (3,); None: the model's.
        loops: closed position loop and its filter for each log, if rows are positions, which ``cells_of`` then makes;
            empty: rows are torques.
        wanted: labels of the columns that have rows, beside deviations of friction's law; empty: all.
    """

    changed: int | None = None
    joints: tuple[int, ...] | None = None
    motors: frozenset[int] = frozenset()
    back_emf: frozenset[int] = frozenset()
    excluded: frozenset[str] = frozenset()
    tolerances: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    noise: Sequence[Array] | None = None
    kept: Sequence[Array] = ()
    inertias: bool = False
    mount: Array | None = None
    loops: Sequence[tuple[ClosedLoop, Filtered]] = ()
    wanted: frozenset[str] = frozenset()


EDGES_HZ = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 3.5, 5.0, 7.0, 10.0])
"""Edges of the noise bands [Hz]. Arm motion is below 5 Hz; structural resonances begin near 10 Hz."""
TOP_SHARE = 0.15
"""Highest frequency of a row, as a share of the log's rate. Derived: the smoothing filter passes 98 % there."""
MOTOR_SHARE = 0.35
"""Factor on the highest frequency if a torque per unit is identified. Servo gears stick and slip above 3.5 Hz."""
FADE_S = 0.25
"""Fade-in and fade-out time of each series [s]. Abrupt ends would leak noise from above the bands into all bands."""
SWAY_HZ, SWAY_S = (1.0, 2.0, 3.0, 4.5, 6.5), 0.5
"""Free vibrations of an elastic joint at the start of a log: frequencies [Hz] and decay time [s]."""
INERTIA, JOINT, ZERO_RAD, LENGTH_M, TILT_RAD, SCALE, DELAY_S = 0.1, 0.03, 2e-3, 1e-3, 5e-3, 0.02, 5e-4
"""Prior standard deviations of a healthy robot; the first two relative to the model's inertias, rotors and friction."""
UNKNOWN_SCALE = 0.1
"""Prior standard deviation of the scale if a torque per unit is identified: as uncertain as the masses."""
LEAST_COM_M = 0.01
FORM = 0.1
"""Prior standard deviation of the error of the model's friction law, as a share of that friction."""
PAYLOAD_M, PAYLOAD_KG = 0.15, 2.0
MOMENTS = ("m", "mx", "my", "mz", "xx", "yy", "zz", "xy", "xz", "yz")
READ_RAD = 0.02
"""Prior standard deviation of an unlisted position error [rad]."""
UNLISTED_NATS = 5.0
"""Prior log odds of a listed cause over an unlisted one."""

Values = Mapping[str, float]


@dataclass(eq=False)
class JointProblem(Pushes):
    """A linear problem that implements ``evidence.search.Linear``.

    Attributes:
        model: the robot as described.
        parts: smoothed logs at the linearisation point.
        cells, groups, families, laws: see ``evidence.search.Linear``.
        withheld: groups of excluded causes; their tolerances stay in the prior.
        mount: see ``Given``.
        labels: names of the columns.
        tolerance: prior standard deviations of a healthy robot, shape (K,); 0 if it lacks the column.
        series: the columns as time series by joint.
        joints: signals by joint and log.
        dry: Coulomb friction in the model, shape (J,).
        pushed: joint torques per newton on the last link along the world axes, shape (W, J, 3) for each log; empty: do
            not look for pushes.
        resting: for each joint, the columns of friction at rest and their standard deviations per newton metre.
        residual: measured minus modelled torques, shape (W, J) for each log.
        sensors: variances of the sensor noise, shape (C, bands); None: unknown.
        channel: channel index of each joint with torques.
        changed: number of leading logs in which causes may act; None: all.
        dry_in_all: for each joint, the Coulomb friction column that also acts in the reference.
        stand: stands that may yield; None: do not look for one.
    """

    model: SerialModel
    parts: list[Signals]
    cells: Cells
    groups: list[Group] = field(default_factory=list)
    withheld: list[Group] = field(default_factory=list)
    families: list[list[int]] = field(default_factory=list)
    laws: list[list[int]] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    tolerance: list[float] = field(default_factory=list)
    series: list[Series] = field(default_factory=list)
    joints: list[list[JointSignals]] = field(default_factory=list)
    dry: Array = field(default_factory=lambda: np.zeros(0))
    resting: list[tuple[list[int], Array]] = field(default_factory=list)
    pushed: list[Array] = field(default_factory=list)
    residual: list[Array] = field(default_factory=list)
    sensors: Array | None = None
    channel: Mapping[int, int] = field(default_factory=dict)
    changed: int | None = None
    dry_in_all: dict[int, int] = field(default_factory=dict)
    mount: Array | None = None
    stand: Stand | None = None

    def place(self, group: Group) -> Group:
        """Add the columns of a push or of a stand."""
        if self.stand is None or group.cause != "soft_stand":
            return super().place(group)
        return replace(group, columns=tuple(self.cells.add(self.rows(self.stand.series(group.shape)))))

    def nearby(self, group: Group, posterior: Posterior) -> list[Group]:
        """Variants of a push, or the stand whose springs explain most."""
        if self.stand is None or group.cause != "soft_stand":
            return super().nearby(group, posterior)
        return [self.stand.fitted(group, posterior, self.cells, self.rows)]

    def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
        """Prior variances without the chosen causes; friction at rest scales with Coulomb friction."""
        S = np.array(self.tolerance) ** 2
        rubs = self.dry.copy()
        if values is not None:
            index = {name: j for j, name in enumerate(self.model.joints)}
            known = [self.model.joints[j] for j in self.channel]
            named = {cause.name: cause.rubs for cause in CAUSES}
            for c in chosen:
                dry = named.get(c.group.cause)
                if dry is not None:
                    members = c.group.members or (c.group.columns,)
                    places = known if c.group.members else (c.group.place,)
                    for place, member in zip(places, members, strict=True):
                        j = index[place]  # keep the sign: several terms add up to one torque
                        rubs[j] += dry(float(values[member[0]]), self.joints[j][0].span)
            for j, k in self.dry_in_all.items():
                rubs[j] += values[k]
        for j, (columns, unit) in enumerate(self.resting):
            S[columns] = (unit * rubs[j]) ** 2
        return S

    def slabs(self) -> Array:
        """Prior variances if every listed cause is in the model, shape (K,)."""
        S = np.array(self.tolerance) ** 2
        for g in self.groups:
            if g.cause == "unlisted":
                continue  # unlisted functions can explain the noise of a short log
            k = list(g.columns)
            S[k] = np.maximum(S[k], np.array(g.slab) ** 2)
        for j, (columns, unit) in enumerate(self.resting):
            S[columns] = np.maximum(
                S[columns], (unit * max(self.dry[j], 0.1 * self.joints[j][0].span.torque)) ** 2
            )
        return S

    def shifted(self, residual: Sequence[Array], values: Values, share: float = 1.0) -> list[Array]:
        """Residuals plus a share of what the columns make of ``values``, one array (W, J) for each log."""
        out = [own.copy() for own in residual]
        for label, series in zip(self.labels, self.series, strict=True):
            if value := share * values.get(label, 0.0):
                for c, x in series.items():
                    for own, column in zip(out, x, strict=True):
                        own[:, c] += value * column
        return out

    def _swaying(self, group: Group, compliance: float) -> list[Series]:
        """Free vibrations of an elastic joint at the start of each log, scaled by its deflection under load."""
        joint, out = self.model.joints.index(group.place), []
        for t, s in enumerate(self.parts):
            time = np.maximum(s.time - s.time[0], 0.0)
            size = 10.0 * compliance * float(np.sqrt(np.mean(s.inverse[:, joint] ** 2)))
            for hz in SWAY_HZ:
                for wave in (np.sin, np.cos):
                    way = [np.zeros(len(p.time)) for p in self.parts]
                    way[t] = size * wave(2.0 * np.pi * hz * time) * np.exp(-time / SWAY_S)
                    out.append(self.displaced(joint, way))
        return out

    def displaced(self, joint: int, way: Sequence[Array]) -> Series:
        """Torque change if a joint's true position differs from the model by ``way``, one array (W,) for each log."""
        moved = [along(s, joint, x) for s, x in zip(self.parts, way, strict=True)]
        return {
            c: [m[:, c] for m in moved] for c in range(len(self.joints)) if any(m[:, c].any() for m in moved)
        }

    def forms(self, group: Group, values: Array) -> list[Series]:
        """Columns for the error of a cause's law: its trace times smooth functions of the joint state.

        A joint offset varies with the angle, as with an off-centre encoder disc.
        Inertial causes have exact laws and no forms.
        """
        if group.event:
            force = 3.0 * values[list(group.columns)]
            return self.rows([self.push(group, force, wave) for wave in (2, 3, 4)])
        if group.cause == "joint_zero":
            joint, zero = self.model.joints.index(group.place), float(values[group.columns[0]])
            turns = [[zero * wave(s.q[:, joint]) for s in self.parts] for wave in (np.sin, np.cos)]
            return self.rows([self.displaced(joint, way) for way in turns])
        named = {cause.name: cause for cause in CAUSES}
        if group.cause not in named and group.cause not in ("coupled_drive", "elasticity", "backlash"):
            return []
        out: list[Series] = []
        if group.cause == "elasticity":
            out = self._swaying(group, float(values[group.columns[0]]))
        members = group.members or (group.columns,)
        loose = named[group.cause].loose if group.cause in named else 1.0
        for member in members:
            for c in {c for k in member for c in self.series[k]}:
                signals = self.joints[c]
                if group.cause == "friction":
                    coulomb, viscous = (abs(float(values[k])) for k in member)
                    out += [
                        {c: x} for x in friction.other_forms(signals, coulomb, viscous, loose, 3.0 * loose)
                    ]
                    continue
                trace = [
                    loose * sum(values[k] * self.series[k][c][t] for k in member if c in self.series[k])
                    for t in range(len(signals))
                ]
                each = [friction.smooth(s) for s in signals]
                out += [
                    {c: [e * f[i] for e, f in zip(trace, each, strict=True)]} for i in range(len(each[0]))
                ]
                size = np.sqrt(np.mean(np.concatenate(trace) ** 2))
                slope = [np.gradient(e, s.step_s) for e, s in zip(trace, signals, strict=True)]
                steep = np.sqrt(np.mean(np.concatenate(slope) ** 2)) + 1e-12
                out.append({c: [x * size / steep for x in slope]})
        return self.rows(out)


def joint_problem(
    model: SerialModel, smooth: Sequence[Signals], values: Values | None = None, given: Given | None = None
) -> JointProblem:
    """Build the problem, linearised around ``values`` by column label; None: around the model as it is."""
    return _Builder(model, list(smooth), values or {}, given or Given()).built()


class _Builder:
    def __init__(self, model: SerialModel, smooth: list[Signals], values: Values, more: Given) -> None:
        self.model, self.values, self.names, self.more = model, values, model.joints, more
        self.J = len(model.joints)
        self.given = smooth[0].tree
        self.tree = self._tree()
        zero = np.array([values.get(f"{n} zero", 0.0) for n in self.names])
        self.parts = []
        for s in smooth:
            q, inverse = s.q + zero, s.inverse
            if values:
                # Keep model terms beyond rigid bodies, such as springs.
                inverse = inverse + torque_of(self.tree, q, s.dq, s.ddq) - rigid_torque(s.motion)
            self.parts.append(replace(s, tree=self.tree, q=q, inverse=inverse))
        self.slow = REST * self.parts[0].slow
        self.spans = self._spans()
        self.joints: list[list[JointSignals]] = [[] for _ in self.names]
        self._known: dict[str, int] = {}
        residual = [self._residual(s) for s in self.parts]
        rates = [s.rate_hz for s in self.parts]
        top = min(TOP_SHARE * min(s.log.rate_hz for s in smooth), EDGES_HZ[-1])
        top *= MOTOR_SHARE if more.motors else 1.0
        edges = np.append(EDGES_HZ[0.8 * top > EDGES_HZ], top)
        self.residual = residual
        known = range(self.J) if more.joints is None else more.joints
        kept = [w[:, list(known)] for w in more.kept]
        self.bands = Bands(rates, [len(r) for r in residual], edges, FADE_S, kept)
        if more.loops:
            self.bands = bands_of([loop for loop, _ in more.loops])
        self.channel = {j: c for c, j in enumerate(known)}
        self.out = JointProblem(
            model, self.parts, self._cells(residual), joints=self.joints, channel=self.channel
        )
        self.out.dry = np.array(self.given.coulomb)
        for j in more.motors:  # a stuck servo's torque follows its position error, not the load
            self.out.dry[j] = max(self.out.dry[j], self.spans[j].torque)

    def _tree(self) -> Tree:
        t, v = self.given, self.values
        if not v:
            return t
        mass, com, inertia, position = t.mass.copy(), t.com.copy(), t.inertia.copy(), t.position.copy()
        for b in t.links:
            n = self.model.model.body(int(b)).name
            mass[b] *= max(1.0 + v.get(f"{n} mass share", 0.0), 0.05)
            com[b] += [v.get(f"{n} com {x}", 0.0) for x in "xyz"]
            inertia[b] *= max(1.0 + v.get(f"{n} inertia share", 0.0), 0.05)
            load = [v.get(f"payload {n} {x}", 0.0) for x in MOMENTS]
            if any(load):
                mass[b], com[b], inertia[b] = with_load(float(mass[b]), com[b], inertia[b], np.array(load))
        for j, n in enumerate(self.names):
            position[t.joint_body[j]] += [v.get(f"{n} length {x}", 0.0) for x in "xyz"]
        g = gravity_at(t.gravity, self.more.mount, v)
        return replace(t, mass=mass, com=com, inertia=inertia, position=position, gravity=g)

    def _spans(self) -> list[Span]:
        def every(of: Callable[[Signals], Array]) -> Array:
            return np.concatenate([of(s) for s in self.parts])

        def size(of: Callable[[Signals], Array]) -> Array:
            return np.sqrt(np.mean(every(of) ** 2, axis=0)) + 1e-9

        q, until = every(lambda s: s.q), max(float(s.time[-1]) for s in self.parts)
        middle, travel = 0.5 * (q.max(axis=0) + q.min(axis=0)), np.ptp(q, axis=0) + 1e-9
        sizes = size(lambda s: s.torque), size(lambda s: s.dq), size(lambda s: s.ddq), travel, middle
        return [Span(*own, until_s=until) for own in np.transpose(sizes).tolist()]

    def _residual(self, s: Signals) -> Array:
        v = self.values
        step = 1.0 / s.rate_hz
        side = np.column_stack([friction.direction(s.dq[:, j], step, self.slow[j]) for j in range(self.J)])
        of = lambda what: np.array([v.get(f"{n} {what}", 0.0) for n in self.names])  # noqa: E731
        torque = s.torque
        late = of("delay_s")
        by_delay = s.by_delay
        if late.any() and s.by_command is not None and by_delay is not None:
            then = s.time[:, None] - late
            told, by_delay = (
                np.column_stack([np.interp(at, s.time, x) for at, x in zip(then.T, own.T, strict=True)])
                for own in (s.by_command, by_delay)
            )
            torque = torque + told - s.by_command
        elif late.any() and by_delay is None:
            torque = np.column_stack([
                CubicSpline(s.time, torque[:, j])(np.clip(s.time + late[j], s.time[0], s.time[-1]))
                for j in range(self.J)
            ])  # fmt: skip
        asked = s.inverse + (self.given.coulomb + of("coulomb_Nm")) * side
        asked = asked + (self.given.viscous + of("viscous_Nms_per_rad")) * s.dq + of("armature_kgm2") * s.ddq
        load = s.inverse - self.given.armature * s.ddq
        load = low_pass(load, s.rate_hz, min(EDGES_HZ[-1], 0.2 * s.rate_hz))  # filter: noise has no direction
        by_delay = -np.gradient(torque, step, axis=0) if by_delay is None else by_delay
        for j in range(self.J):
            own = (x[:, j] for x in (s.q, s.dq, s.ddq, side, load, asked, torque, by_delay))
            self.joints[j].append(JointSignals(*own, t=s.time, span=self.spans[j]))
        return torque - asked * (1.0 + of("scale"))

    def _cells(self, residual: Sequence[Array]) -> Cells:
        if self.more.loops:
            return Cells.of(self.bands, [np.zeros((n, len(self.channel))) for n in self.bands.lengths])
        return Cells.of(self.bands, [r[:, list(self.channel)] for r in residual])

    # --- columns

    def add(self, label: str, tolerance: float, by: Series) -> int:
        kept = not self.more.wanted or label in self.more.wanted or " form " in label
        self.out.series.append(by if kept else {})
        self.out.labels.append(label)
        self.out.tolerance.append(float(tolerance))
        return len(self.out.labels) - 1

    def wide(self, of: Callable[[Signals], Array]) -> Series:
        done = [of(s) for s in self.parts]
        return {j: [d[:, j] for d in done] for j in range(self.J) if any(d[:, j].any() for d in done)}

    def group(
        self, cause: str, place: str, columns: Sequence[int], slab: Sequence[float] | Array, **more: Any
    ) -> None:
        # Link inertias do not change between reference and later logs; only the payload does.
        same = (
            self.more.changed is not None and more.get("family", "").startswith("load") and cause != "payload"
        )
        if same or not any(j in self.channel for k in columns for j in self.out.series[k]):
            return
        groups = self.out.withheld if cause in self.more.excluded else self.out.groups
        groups.append(Group(cause, place, tuple(columns), tuple(float(x) for x in slab), **more))

    def built(self) -> JointProblem:
        for j in range(self.J):
            self._joint(j)
        named = [i for i, label in enumerate(self.out.labels) if " form " in label]
        self.out.laws += [named] if named else []
        self._kinds()
        for j in range(1, self.J):
            self._geometry(j)
        for j in range(self.J):
            self._elasticity(j)
            if j in self.more.back_emf:
                self._braking(j)
            if self.commanded:
                self._backlash(j)
            limits = [s.by_limit for s in self.parts if s.by_limit is not None]
            if limits:
                self.add(f"{self.names[j]} limit", 0.0, {j: [x[:, j] for x in limits]})
        self._arm()
        if self.commanded and self.more.changed is None:
            self._stand()
        for body in self.tree.links:
            self._link(int(body))
        for j in range(0 if self.more.loops else self.J):  # there, friction at rest is noise of the torque
            self._rests(j)
        out = self.out
        out.changed, out.mount = self.more.changed, self.more.mount
        body = int(self.tree.joint_body[self.tree.last_link])
        none = (
            self.more.motors or self.more.loops or "push" in self.more.excluded
        )  # a sticking gear looks like a push
        for s in () if none else self.parts:
            out.pushed.append(force_torque(s.motion, body, self.tree.com[body]))
        self.residual = out.shifted(
            self.residual, self.values
        )  # relative to the model, not the linearisation point
        if self.more.changed is not None:
            self._apart(self.more.changed)
        if not self.more.loops:
            out.cells = self._cells(self.residual)
            out.cells.add(out.rows(out.series))
        out.residual = self.residual
        if self.more.noise is not None:
            out.sensors = self._sensors(self.more.noise)
        return out

    def _sensors(self, noise: Sequence[Array]) -> Array:
        band = np.concatenate([self.bands.of_trial(t) for t in range(len(noise))])
        rows = np.bincount(band, minlength=len(self.bands.edges_hz) - 1)
        power = [
            np.bincount(band, self.bands.spectrum([x[:, j] for x in noise], c) ** 2, len(rows))
            / self.bands.share(c)
            for j, c in self.channel.items()
        ]
        return np.array(power) / np.maximum(rows, 1)

    def _apart(self, changed: int) -> None:
        """Restrict each column to the logs before the reference, and add a column that acts in all logs."""
        out, slabs = self.out, np.sqrt(self.out.slabs())
        local = {k for columns, _ in out.resting for k in columns}
        for i in range(len(out.labels)):
            if i in local or not slabs[i]:
                continue
            own = out.series[i]
            self.add(f"{out.labels[i]} in all logs", slabs[i], own)
            out.tolerance[i] = 0.0
            if out.labels[i].endswith(" coulomb_Nm"):
                out.dry_in_all[self.names.index(out.labels[i].removesuffix(" coulomb_Nm"))] = (
                    len(out.labels) - 1
                )
            out.series[i] = {
                j: [x if t < changed else np.zeros_like(x) for t, x in enumerate(series)]
                for j, series in own.items()
            }

    def _tolerance(self, j: int, cause: str, parameter: str) -> float:
        t = self.given
        usual = {
            "coulomb_Nm": JOINT * t.coulomb[j], "viscous_Nms_per_rad": JOINT * t.viscous[j],
            "armature_kgm2": JOINT * t.armature[j], "scale": UNKNOWN_SCALE if j in self.more.motors else SCALE,
            "delay_s": DELAY_S,
        }.get(parameter, 0.0)  # fmt: skip
        return self.sd(cause, parameter, usual)

    def sd(self, cause: str, parameter: str, usual: float) -> float:
        """Prior standard deviation of a healthy robot's parameter: the option if given, else ``usual``."""
        return self.more.tolerances.get(cause, {}).get(parameter, usual)

    def _joint(self, j: int) -> None:
        n, t = self.names[j], self.given
        own = {
            "coulomb_Nm": t.coulomb[j],
            "viscous_Nms_per_rad": t.viscous[j],
            "armature_kgm2": t.armature[j],
        }
        for cause in CAUSES:
            exact = (
                cause.name == "torque_scale" and self.commanded
            )  # the gain of a formula, which does not bend
            shapes = cause.shapes[: 1 if exact else None]
            for shape in shapes:
                plain = not any(shape.values())
                columns = [cause.columns(s, shape) for s in self.joints[j]]
                index = []
                for k, p in enumerate(cause.parameters):
                    shared = plain and cause.name != "warming"
                    label = f"{n} {p}" if shared else f"{n} {cause.name} {p} {dict(shape)}"
                    if shared and label in self._known:
                        index.append(self._known[label])
                        continue
                    tolerance = self._tolerance(j, cause.name, p) if shared else 0.0
                    index.append(self.add(label, tolerance, {j: [c[k] for c in columns]}))
                    self._known[label] = index[-1]
                least = tuple(-own.get(p, 0.0) if p in cause.positive else -np.inf for p in cause.parameters)
                self.group(
                    cause.name, n, index, cause.slab(self.spans[j], shape), log_prior=-math.log(len(shapes)),
                    shape=tuple(shape.items()), least=least if cause.positive else (),
                )  # fmt: skip
        unlisted = () if self.more.wanted else functions(self.joints[j], self.joints[j - 1])
        for number, (signal, terms) in enumerate(unlisted):
            if signal == "neighbour's torque" and not j:
                continue
            # Gravity deflects an elastic joint by a function of its position, as a reading error does.
            read, slab = signal == "reading", READ_RAD if signal == "reading" else self.spans[j].torque
            index = [
                self.add(f"{n} unlisted {signal} {k}", 0.0, self.out.displaced(j, x) if read else {j: x})
                for k, x in enumerate(terms)
            ]
            self.group(
                "unlisted", n, index, slab * SIZES, log_prior=-UNLISTED_NATS - math.log(len(SIGNALS)),
                shape=(("signal", float(number)),), late=True, family=f"angle of {n}" if read else "",
            )  # fmt: skip
        if t.coulomb[j] or t.viscous[j]:
            # A model with damping of higher degree tells that another law holds.
            other = bool(self.more.loops) or (self.commanded and bool(t.drag[j].any()))
            sizes = float(t.coulomb[j]), float(t.viscous[j])
            for i, x in enumerate(friction.deviations(self.joints[j], *sizes, FORM, servo=other)):
                self.add(f"{n} form {i}", 1.0, {j: x})

    def _kinds(self) -> None:
        """Add the causes that affect all joints alike: a common part and a deviation for each joint."""
        for cause in (c for c in CAUSES if c.kind):
            members = [g for g in self.out.groups if g.cause == cause.name and not any(v for _, v in g.shape)]
            if len(members) < 2:
                continue
            self.group(
                cause.name, "all joints", [k for g in members for k in g.columns], [s for g in members for s in g.slab],
                least=tuple(x for g in members for x in g.least), members=tuple(g.columns for g in members),
            )  # fmt: skip

    def _geometry(self, j: int) -> None:
        n, body = self.names[j], int(self.tree.joint_body[j])
        tolerance = self.sd("joint_zero", "zero_rad", ZERO_RAD)
        zero = self.add(f"{n} zero", tolerance, self.wide(lambda s: along(s, j, np.ones(len(s.time)))))
        self.group("joint_zero", n, [zero], [0.1])
        moved = {id(s): by_displacement(s.motion, body) for s in self.parts}
        lengths = []
        for k, x in enumerate("xyz"):
            tolerance = self.sd("link_length", f"{x}_m", LENGTH_M)
            column = self.wide(lambda s, k=k: moved[id(s)][:, :, k])
            lengths.append(self.add(f"{n} length {x}", tolerance, column))
        self.group("link_length", n, lengths, [0.02] * 3)
        self._coupled(j)

    def _coupled(self, j: int) -> None:
        p, n, z = j - 1, self.names[j], self.spans[j]
        for ratio in (1.0, -1.0):
            by: tuple[Series, ...] = tuple({j: [], p: []} for _ in range(3))
            for s in self.parts:
                v, a = s.dq[:, j] + ratio * s.dq[:, p], s.ddq[:, j] + ratio * s.ddq[:, p]
                side = friction.direction(v, 1.0 / s.rate_hz, self.slow[j] + self.slow[p])
                for k, x in enumerate((side, v, a)):
                    by[k][j].append(x)  # type: ignore[attr-defined]
                    by[k][p].append(ratio * x)  # type: ignore[attr-defined]
            index = [self.add(f"{n} coupled {ratio:+.0f} {k}", 0.0, by[k]) for k in range(3)]
            slab = [z.torque, z.torque / z.speed, z.torque / z.acceleration]
            self.group("coupled_drive", n, index, slab, log_prior=-math.log(2.0), shape=(("ratio", ratio),))

    def _elasticity(self, j: int) -> None:
        def series(s: Signals) -> Array:
            return along(s, j, -low_pass(s.inverse[:, j], s.rate_hz, min(7.0, 0.2 * s.rate_hz)))

        k = self.add(f"{self.names[j]} compliance", 0.0, self.wide(series))
        self.group("elasticity", self.names[j], [k], [1e-3], least=(0.0,), family=f"angle of {self.names[j]}")

    def _braking(self, j: int) -> None:
        by = [np.where(s.enabled, s.dq[:, j], 0.0) for s in self.parts]
        k = self.add(f"{self.names[j]} braking", 0.0, {j: by})
        z = self.spans[j]
        self.group("back_emf", self.names[j], [k], [z.torque / z.speed], least=(0.0,))

    @property
    def commanded(self) -> bool:
        """Whether commands tell the torques, and rows are torques."""
        return not self.more.loops and all(s.by_command is not None for s in self.parts)

    def _backlash(self, j: int) -> None:
        n, t = self.names[j], self.given
        each = backlash.columns(self.parts, self.joints[j], j, float(t.viscous[j]), float(t.armature[j]))
        for shape, torques in zip(backlash.SHAPES, each, strict=True):
            of = {id(s): torque for s, torque in zip(self.parts, torques, strict=True)}
            k = self.add(f"{n} backlash {dict(shape)}", 0.0, self.wide(lambda s, of=of: of[id(s)]))
            self.group(
                "backlash", n, [k], [backlash.WIDTH_RAD], least=(0.0,), shape=shape,
                log_prior=-math.log(len(backlash.SHAPES)),
            )  # fmt: skip

    def _stand(self) -> None:
        stand = Stand(self.parts)
        for number, shape in enumerate(stand.first()):
            own = [self.add(f"stand {number} {k}", 0.0, x) for k, x in enumerate(stand.series(shape))]
            group = stand.group(shape, own)
            (self.out.withheld if group.cause in self.more.excluded else self.out.groups).append(group)
        self.out.stand = stand

    def _arm(self) -> None:
        g = self.tree.gravity
        if not g.any():
            return
        by = {id(s): by_acceleration(s.motion) for s in self.parts}
        sizes = [*(self.sd("gravity_direction", f"tilt_{i}_rad", TILT_RAD) for i in (1, 2)), 0.0]
        columns = [
            self.add(label, size, self.wide(lambda s, way=way: by[id(s)] @ way))
            for size, (label, way) in zip(
                sizes, ways(self.given.gravity, self.more.mount).items(), strict=False
            )
        ]
        self.group("gravity_direction", "base", columns, [0.1, 0.1, 1.0][: len(columns)])
        share = self.add("gravity share", 0.0, self.wide(lambda s: by[id(s)] @ g))
        self.group("gravity_compensation", "robot", [share], [0.5])

    def _link(self, body: int) -> None:
        # Torques are linear in mass times centre of mass, so linearise both around their current values.
        n, t, zero = self.model.model.body(body).name, self.given, np.zeros((3, 3))
        Y = {id(s): body_regressor(s.motion, body) for s in self.parts}
        m, c = t.mass[body], t.com[body]
        loaded = body == self.tree.joint_body[self.tree.last_link] or body == self.tree.links[-1]
        family = f"load of {n}" if loaded else ""

        def column(label: str, tolerance: float, change: Array) -> int:
            return self.add(label, tolerance, self.wide(lambda s: Y[id(s)] @ change))

        spread = self.sd("link_mass", "excess_kg", INERTIA * float(m)) / max(float(m), 1e-9)
        moved = (
            {} if loaded else self.values
        )  # payload columns are exactly linear and need no linearisation point
        at = c + [moved.get(f"{n} com {x}", 0.0) for x in "xyz"]
        mass = column(f"{n} mass share", spread, inertial_parameters(m, at, zero))
        half, heavy = -math.log(2.0), m * max(1.0 + moved.get(f"{n} mass share", 0.0), 0.05)
        self.group("link_mass", n, [mass], [1.0], log_prior=half, family=family)
        coms = []
        for k in range(3):
            e = 1e-4 * np.eye(3)[k]
            change = inertial_parameters(heavy, at + e, zero) - inertial_parameters(heavy, at - e, zero)
            tolerance = self.sd("link_com", f"{'xyz'[k]}_m", INERTIA * max(abs(c[k]), LEAST_COM_M))
            coms.append(column(f"{n} com {'xyz'[k]}", tolerance, change / 2e-4))
        self.group("link_com", n, coms, [0.1] * 3, family=family)
        spread = self.sd("link_inertia", "share", INERTIA)
        inertia = column(f"{n} inertia share", spread, inertial_parameters(0.0, np.zeros(3), t.inertia[body]))
        self.group("link_inertia", n, [inertia], [2.0], family=family)
        whole = [mass, *coms, inertia]
        self.group(
            "link_mass", n, whole, [1.0, 0.1, 0.1, 0.1, 2.0], log_prior=half, family=family, shape=(("whole", 1.0),),
        )  # fmt: skip
        if loaded or self.more.inertias:
            r = PAYLOAD_M
            index = [self.add(f"payload {n} {x}", 0.0, self.wide(lambda s, i=i: Y[id(s)][:, :, i]))
                     for i, x in enumerate(MOMENTS)]  # fmt: skip
            slab = PAYLOAD_KG * np.array([1.0, r, r, r] + [0.5 * r * r] * 6)
            least = 0.0 if self.more.changed is None else -np.inf
            self.group("payload", n, index, slab, least=(least,) + (-np.inf,) * 9, family=family)

    def _rests(self, j: int) -> None:
        columns, unit, turns = [], [], []
        common: list[list[Array]] = [[], [], []]
        most = friction.MOST_IN_ALL if any(s.by_command is not None for s in self.parts) else 0
        for t, s in enumerate(self.joints[j]):
            own, shared = friction.resting(s.v, s.step_s, self.slow[j], most)
            for k in range(3):
                common[k].append(shared[k])
            for number, rest in enumerate(own):
                for k, (first, x) in enumerate(rest):
                    by = [np.zeros(len(o.v)) for o in self.joints[j]]
                    by[t][first : first + len(x)] = x
                    columns.append(self.add(f"{self.names[j]} rest {t} {number} {k}", 0.0, {j: by}))
                    unit.append(1.0 / np.sqrt(3.0 * (1 + k)))
                    if 0 < first < len(by[t]) - len(x):  # a joint at rest from the start may be stuck
                        turns.append(columns[-1])
        if turns:
            self.out.families.append(turns)
        for k in range(3):
            columns.append(self.add(f"{self.names[j]} turning {k}", 0.0, {j: common[k]}))
            unit.append(0.5)
        self.out.resting.append((columns, np.array(unit)))
