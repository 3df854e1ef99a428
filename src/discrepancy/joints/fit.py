"""Linear problem of a calibration around its current values, its solution, and what it determines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.search import floor_of
from discrepancy.joints.causes import parameter_name
from discrepancy.joints.diagnose import in_parts
from discrepancy.joints.link_prior import CENTRAL, LinkPrior, central, fitted_links, welded
from discrepancy.joints.mechanics import inertial_parameters, moments_matrix, rigid_torque, torque_of
from discrepancy.joints.model import SerialModel
from discrepancy.joints.mount import mount_of
from discrepancy.joints.problem import LENGTH_M, MOMENTS, Given, JointProblem, joint_problem
from discrepancy.joints.servo import driven_by_voltage
from discrepancy.joints.signals import Signals
from discrepancy.joints.trials import Trials
from estimator.arrays import Array

ZERO_RAD, TILT_RAD, GAIN, DELAY_S = 0.01, 0.02, 0.02, 2e-3
"""Prior standard deviations of joint zeros [rad or m], base tilt [rad], torque gains and delays [s]. Chosen: those
of a robot that nobody calibrated."""
FREE_GAIN = 0.3
"""Prior standard deviation of the gain of a drive whose torque constant is unknown. Chosen: as uncertain
as the masses."""
DETERMINED = 0.2
"""Largest ratio of standard error and prior standard deviation of a parameter that counts as determined. Chosen: the
logs reduce its variance 25-fold."""
POSES = 20
"""Poses in which inertias that joints feel are computed. Chosen."""
PLAIN = 3.0
"""Factor on prior standard deviations of inertial parameters for standard errors. Chosen: where two parameters have one
effect, the narrower prior would otherwise make the other's error."""
SMALL = 1e-3
"""Share of a combination below which a term is left out. Chosen."""
LEARNING = 4
"""Steps in which variances are learnt, too. Chosen: the fit settles only when they are held."""
LAW_STEPS, LEAST_NATS = 10, 1e-2
"""Most steps for each deviation of friction from its law, and the evidence below which they end. Chosen."""
MOST_STEPS, LEAST_DROP = 200, 1e-6
"""Most Newton steps, and the drop of the negative log posterior at which they end. Chosen."""
BASE, DEPENDENT = 1e-4, 1e-2
"""Singular values over the largest below which columns count as dependent in least squares, and in the combinations
that are told. Chosen."""
TIE = 1e-3
"""Relative lead of a column over the next in the choice of combinations. Chosen: more than fitted lengths change it,
less than the columns of other joints differ."""
RATIO = 0.05
"""Largest difference between a drive's coupling and the ratios 1 and -1 that the columns of coupled drives have."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of the robot or of its log.

    Attributes:
        place: joint, link or ``base``.
        name: quantity with its unit, such as ``coulomb_Nm``.
        model: value of the given model.
        value: posterior mean.
        se: standard error, that of the posterior.
        prior: prior standard deviation.
        determined: whether the logs determine it.
        in_model: whether MJCF holds it; else it is an error of the log.
    """

    place: str
    name: str
    model: float
    value: float
    se: float
    prior: float
    determined: bool
    in_model: bool = True


@dataclass(frozen=True)
class Combination:
    """A combination of parameters that the logs determine where they do not determine each (a base parameter).

    Attributes:
        terms: factor by place and parameter, those of a link about its frame; the first has factor 1.
        model, value, se: value in the given model, posterior mean and standard error.
    """

    terms: Mapping[tuple[str, str], float]
    model: float
    value: float
    se: float


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Prediction of one part of the logs from the others.

    Attributes:
        part: name.
        model, least_squares, calibrated: rms of measured minus predicted torque with the given model, with ordinary
            least squares of the same parameters, and with this fit, shape (J,) [N m or N].
        noise: standard deviation of the sensors' noise in the rows, shape (J,).
        torque: rms of the measured torque, shape (J,).
    """

    part: str
    model: Array
    least_squares: Array
    calibrated: Array
    noise: Array
    torque: Array


@dataclass(frozen=True)
class Scalar:
    """A parameter that is one column of the problem: its place, name, value in the model, bound and export."""

    label: str
    place: str
    name: str
    model: float
    prior: float
    least: float = -np.inf
    in_model: bool = True


class Fit:
    """The fit around its current values.

    Attributes:
        late_s: prior standard deviation of the delays [s].
        friction: of joints whose friction deviates from its law: Coulomb friction and damping of first to third degree.
        steps: steps done.
        deviations: learnt prior variances of deviations of friction from its law, by column.
    """

    late_s = DELAY_S
    friction: Mapping[int, Array] = MappingProxyType({})
    steps = 0

    def __init__(self, model: SerialModel, trials: Trials) -> None:
        self.model, self.trials = model, trials
        self.known = tuple(map(int, trials.joints))
        volts = np.flatnonzero(driven_by_voltage(trials.motors, len(model.joints))).tolist()
        switched = any(s.enabled is not None and not s.enabled.all() for s in trials.runs)
        self.free = frozenset(motor.joint for motor in trials.motors)
        self.given, self.mount = trials.runs[0].tree, None if self.free else mount_of(trials.runs, self.known)
        if self.mount is not None:
            self.given = replace(self.given, gravity=self.mount)
        self.tree, self.values = self.given, dict[str, float]()
        self.options = Given(
            joints=self.known, motors=self.free, back_emf=frozenset(volts if switched else ()), noise=trials.noise,
            kept=trials.kept, inertias=True,
        )  # fmt: skip
        self.bodies = [LinkPrior(self.given, b) for b in fitted_links(self.given)]
        self.links = tuple(body.body for body in self.bodies)
        self.problem = self.linear()
        self.scalars = list(self._scalars())
        self.first = 10 * len(self.bodies)  # number of inertial parameters; scalars follow
        n, basis = self.first, self._gain_basis()
        self.basis = np.zeros((n + len(self.scalars), n + basis.shape[1]))
        self.basis[:n, :n], self.basis[n:, n:] = np.eye(n), basis
        self.x = np.concatenate([*(body.given for body in self.bodies), np.zeros(len(self.scalars))])
        self.least = np.concatenate([np.full(n, -np.inf), [s.least - s.model for s in self.scalars]])
        self.rubbing = n + np.flatnonzero(
            [s.name.endswith(("coulomb_Nm", "viscous_Nms_per_rad")) for s in self.scalars]
        )
        self.given_x, self.curvature = self.x, np.eye(self.basis.shape[1])
        for k, body in enumerate(self.bodies):
            at = slice(10 * k, 10 * k + 10)
            self.curvature[at, at] = body.slopes(body.given)[2]
        self.prior = self.basis @ np.linalg.inv(self.curvature) @ self.basis.T
        self.covariance = self.prior
        self.deviations: dict[str, float] = {}

    # --- parameters

    def _scalars(self) -> Iterator[Scalar]:
        t, problem = self.given, self.problem
        slabs = {g.key: (g, dict(zip(g.columns, g.slab, strict=True))) for g in problem.groups if not any(
            v for k, v in g.shape if k != "ratio")}  # fmt: skip
        for j in self.known:
            n = self.model.joints[j]
            span = problem.joints[j][0].span
            yield Scalar(f"{n} coulomb_Nm", n, "coulomb_Nm", t.coulomb[j], span.torque, 0.0)
            yield Scalar(
                f"{n} viscous_Nms_per_rad",
                n,
                "viscous_Nms_per_rad",
                t.viscous[j],
                span.torque / span.speed,
                self.least_damping(j),
            )
            yield Scalar(f"{n} armature_kgm2", n, "armature_kgm2", t.armature[j], self._rotor(j), 0.0)
            if ("back_emf", n) in slabs:
                yield Scalar(
                    f"{n} braking", n, "braking_Nms_per_rad", 0.0, span.torque / span.speed, 0.0, False
                )
            yield Scalar(f"{n} offset_Nm", n, "offset_Nm", 0.0, span.torque, in_model=False)
            gain = self.gain_prior(j)
            if len(self.known) > 1 or gain == FREE_GAIN:
                yield Scalar(f"{n} scale", n, "gain", 0.0, gain, in_model=False)
            yield Scalar(f"{n} delay_s", n, "delay_s", 0.0, self.late_s, in_model=False)
            yield from self.more_scalars(j)
        for j, n in enumerate(self.model.joints):
            if j:
                yield Scalar(f"{n} zero", n, "zero_rad", 0.0, ZERO_RAD)
                for axis in "xyz":
                    yield Scalar(f"{n} length {axis}", n, f"position_{axis}_m", 0.0, LENGTH_M)
            ratio = self._coupling(j)
            if ratio:
                span = problem.joints[j][0].span
                sizes = span.torque, span.torque / span.speed, self._rotor(j)
                for k, name in enumerate(
                    ("coupled_coulomb_Nm", "coupled_viscous_Nms_per_rad", "coupled_armature_kgm2")
                ):
                    yield Scalar(f"{n} coupled {ratio:+.0f} {k}", n, name, 0.0, sizes[k], 0.0)
        if t.gravity.any():
            for i in range(2):
                yield Scalar(f"tilt {i}", "base", f"tilt_{i + 1}_rad", 0.0, TILT_RAD)

    def more_scalars(self, j: int) -> Iterator[Scalar]:
        """Further parameters of a joint's drive."""
        yield from ()

    def gain_prior(self, j: int) -> float:
        """Prior standard deviation of the relative error of a joint's torque."""
        return FREE_GAIN if j in self.free else GAIN

    def least_damping(self, j: int) -> float:
        """Least viscous friction of a joint."""
        return 0.0

    def _rotor(self, j: int) -> float:
        """Prior standard deviation of a rotor: the largest inertia that a joint of this kind feels."""
        t, q = self.given, self.trials.runs[0].q
        q = q[:: max(1, len(q) // POSES)]
        still, found = np.zeros_like(q), []
        for k in np.flatnonzero(t.slides[: q.shape[1]] == t.slides[j]):
            unit = np.zeros_like(q)
            unit[:, k] = 1.0
            felt = torque_of(t, q, still, unit) - torque_of(t, q, still, still)
            found.append(float(np.max(felt[:, k]) + t.armature[k]))
        return max(found)

    def _coupling(self, j: int) -> float:
        """Ratio 1 or -1 if the motor of a joint turns with the joint before it, too; else 0."""
        turns = np.linalg.inv(self.trials.runs[0].log.drive.coupling)
        if not j or not {j, j - 1} <= set(self.known):
            return 0.0
        ratio = turns[j, j - 1] / turns[j, j]
        return float(np.sign(ratio)) if abs(abs(ratio) - 1.0) < RATIO else 0.0

    def _gain_basis(self) -> Array:
        """Columns from standard normal variables to the deviations of the scalars, shape (S, S or S - 1).

        Without a weight, torques tell masses and gains only up to a common factor, so the mean gain of drives with
        known torques is held at 1.
        """
        out = np.diag([s.prior for s in self.scalars])
        tied = [i for i, s in enumerate(self.scalars) if s.name == "gain" and s.prior == GAIN]
        if not tied:
            return out
        even = np.full((len(tied), 1), len(tied) ** -0.5)
        rest = np.linalg.qr(np.column_stack([even, np.eye(len(tied))[:, :-1]]))[0][:, 1:]
        out[np.ix_(tied, tied[:-1])] = GAIN * rest
        return np.delete(out, tied[-1], axis=1)

    # --- the linear problem

    def linear(self) -> JointProblem:
        t, before = self.tree, self.given
        parts: list[Signals] = []
        for s in self.trials.runs:
            inverse = s.inverse + torque_of(t, s.q, s.dq, s.ddq) - rigid_torque(s.motion)
            parts.append(replace(s, tree=t, inverse=inverse + (t.armature - before.armature) * s.ddq))
        return joint_problem(self.model, parts, self.values, self.options)

    def columns(self) -> NDArray[np.intp]:
        """Columns of the problem that are fitted, in the order of ``x``."""
        place = {label: k for k, label in enumerate(self.problem.labels)}
        names = [f"payload {self.model.model.body(b).name} {m}" for b in self.links for m in MOMENTS]
        return np.array([place[n] for n in [*names, *(s.label for s in self.scalars)]])

    def _at(self) -> Array:
        """Value in ``x`` at which each column of the problem is 0."""
        now = [
            inertial_parameters(t.mass[b], t.com[b], t.inertia[b]) for t in [self.tree] for b in self.links
        ]
        own = []
        for s in self.scalars:
            joint = self.model.joints.index(s.place) if s.place in self.model.joints else -1
            size = {
                "coulomb_Nm": self.tree.coulomb - self.given.coulomb,
                "viscous_Nms_per_rad": self.tree.viscous - self.given.viscous,
                "armature_kgm2": self.tree.armature - self.given.armature,
            }.get(s.name)
            own.append(0.0 if size is None else float(size[joint]))
        return np.concatenate([*now, own])

    def step(self) -> float:
        """Fit around the current values, and move there; return the largest step in standard errors."""
        self.prepare()
        found, self.covariance = self.solved(range(len(self.normals)))
        way = (found - self.x) / np.sqrt(np.diag(self.covariance))
        self.x = found
        self.jump(self.x)
        self.steps += 1
        return float(np.max(np.abs(way)))

    def prepare(self) -> None:
        """Build the normal equations of all parts around the current values."""
        self.problem = self.linear()
        columns, self.at = self.columns(), self._at()
        prior = self.problem.prior((), None)
        slabs = np.zeros(len(prior))
        slabs[columns] = np.diag(self.prior)
        rests = [k for own, _ in self.problem.resting for k in own if prior[k]]
        laws = [k for k, n in enumerate(self.problem.labels) if prior[k] and " form " in n]
        slabs[rests] = prior[rests]
        plain = floor_of(self.problem, slabs)
        slabs[laws] = prior[laws]
        if self.steps < LEARNING:
            self._learn(slabs)
            self.deviations = {self.problem.labels[k]: slabs[k] for k in laws}
        else:
            slabs[laws] = [self.deviations.get(self.problem.labels[k], 0.0) for k in laws]
        self.active, laws = np.flatnonzero(slabs), [k for k in laws if slabs[k]]
        self.series, each = in_parts(self.problem, self.active, self.trials)
        self.variance = plain
        self.rows = [own.rows for own in each]
        self.plain, self.normals = (
            [own.weighted(v)[:2] for own in each] for v in (plain, floor_of(self.problem, slabs))
        )
        self.fit, self.rests, self.laws = (
            np.searchsorted(self.active, np.array(k, dtype=np.intp)) for k in (columns, rests, laws)
        )
        self.spread = slabs[self.active]

    def _learn(self, slabs: Array) -> None:
        """Set, in place, the prior variance of each deviation of friction from its law to its likeliest, often zero.

        One at a time, the most profitable first: M. E. Tipping and A. C. Faul, "Fast marginal likelihood maximisation
        for sparse Bayesian models", AISTATS 2003. A deviation is in the fit only if it raises the log evidence
        by more than the log of the number of deviations of a joint, of which any one is as likely as another.
        """
        forms = np.flatnonzero([" form " in n for n in self.problem.labels] & (slabs > 0.0))
        variance, prior = floor_of(self.problem, slabs), np.zeros(len(forms))
        slabs[forms] = 0.0
        R, Q = Posterior(self.problem.cells, slabs, variance).conditional(forms)
        odds = np.log(max(len(forms), 1) / len(self.known))
        for _ in range(LAW_STEPS * len(forms)):
            on = np.flatnonzero(prior)
            inner = np.diag(1.0 / prior[on]) + R[np.ix_(on, on)]
            others = np.linalg.solve(inner, np.column_stack([R[on], Q[on]]))
            S = np.diag(R) - np.einsum("ik,ik->k", R[on], others[:, :-1])
            score = Q - R[on].T @ others[:, -1]
            own = np.maximum(1.0 - prior * S, 1e-12)  # what is left of a column without itself
            S, score = np.maximum(S / own, 1e-30), score / own
            best = np.maximum(score**2 - S, 0.0) / S**2

            def worth(x: Array, S: Array = S, score: Array = score) -> Array:
                return 0.5 * (score**2 * x / (1.0 + x * S) - np.log1p(x * S)) - odds * (x > 0.0)

            best = np.where(worth(best) > 0.0, best, 0.0)
            gained = worth(best) - worth(prior)
            k = int(np.argmax(gained))
            if gained[k] < LEAST_NATS:
                break
            prior[k] = best[k]
        slabs[forms] = prior

    def solved(self, parts: Sequence[int]) -> tuple[Array, Array]:
        """Values of ``x`` and their covariance from some parts.

        Friction that deviates from its law is a nuisance for all other values. Coulomb and viscous friction are then
        the law nearest to it: the fit without deviations. Its difference from that with them counts as an error, also
        at a bound.
        """
        x, covariance = self.lawful(parts)
        H, g = self._reduced(self.plain, parts, self.rests)
        at = self.rubbing
        least = self.least[at]
        lawful, nearest, free = x[at], x[at], np.ones(len(at), dtype=bool)
        while free.any():
            k = at[free]
            rest = np.setdiff1d(np.arange(len(x)), k)
            inner, now = H[np.ix_(k, k)], self.x
            score = g[k] - H[np.ix_(k, rest)] @ (x - now)[rest] + inner @ now[k]
            nearest[free] = np.linalg.solve(inner + np.diag(1.0 / np.diag(self.prior)[k]), score)
            beyond = free & (nearest < least)
            if not beyond.any():
                break
            nearest[beyond], x[at[beyond]] = least[beyond], least[beyond]
            free &= ~beyond
        covariance[at, at] += (nearest - lawful) ** 2
        x[at] = nearest
        return x, covariance

    def lawful(self, parts: Sequence[int]) -> tuple[Array, Array]:
        """Values of ``x`` beside the deviations of friction from its law, and their covariance, from some parts."""
        H, g = self._reduced(self.normals, parts, np.concatenate([self.rests, self.laws]))
        information, start = self.basis.T @ H @ self.basis, np.linalg.pinv(self.basis) @ self.x
        y = self._mode(information, self.basis.T @ (g - H @ (self.basis @ start - self.x)), start)
        x = np.maximum(self.basis @ y, self.least)  # rounding may end below a bound
        # For errors, the prior counts with its curvature at the given model, and less, so that it does not make them.
        weak = self.curvature.copy()
        weak[: self.first, : self.first] /= PLAIN**2
        covariance = self.basis @ np.linalg.inv(information + weak) @ self.basis.T
        return x, covariance

    def explained(self, parts: Sequence[int]) -> tuple[Array, list[tuple[int, float]]]:
        """Values of ``x`` beside the deviations of friction from its law, and all columns with their means."""
        x = self.lawful(parts)[0]
        n = np.concatenate([self.rests, self.laws])
        G, b = (sum((self.normals[t][k] for t in parts[1:]), self.normals[parts[0]][k]) for k in range(2))
        inner = G[np.ix_(n, n)] + np.diag(1.0 / self.spread[n])
        means = np.linalg.solve(inner, b[n] - G[np.ix_(n, self.fit)] @ (x - self.at))
        columns = self.active[np.append(self.fit, n)].tolist()
        return x, [*zip(columns, np.append(x - self.at, means).tolist(), strict=True)]

    def _reduced(
        self, normals: Sequence[tuple[Array, Array]], parts: Sequence[int], nuisance: NDArray[np.intp]
    ) -> tuple[Array, Array]:
        """Information matrix and score at the current ``x`` from some parts, with nuisance columns integrated out."""
        G = sum((normals[k][0] for k in parts), np.zeros((len(self.active),) * 2))
        b = sum((normals[k][1] for k in parts), np.zeros(len(self.active)))
        f, n = self.fit, nuisance
        inner = G[np.ix_(n, n)] + np.diag(1.0 / self.spread[n])
        gain = np.linalg.solve(inner, np.column_stack([G[np.ix_(n, f)], b[n]]))
        H = G[np.ix_(f, f)] - G[np.ix_(f, n)] @ gain[:, :-1]
        return H, b[f] - G[np.ix_(f, n)] @ gain[:, -1] + H @ (self.at - self.x)

    def _mode(self, H: Array, g: Array, start: Array) -> Array:
        """Minimum of d' H d / 2 - g' d, with d = y - start, plus the negative log prior.

        Newton's method with an active set of bounds (D. P. Bertsekas, "Projected Newton methods for optimization
        problems with simple constraints", 1982). The function is convex.
        """
        n = self.first
        least = np.full(H.shape[0], -np.inf)
        for i in np.flatnonzero(np.isfinite(self.least)):
            column = np.flatnonzero(self.basis[i])[0]
            least[column] = self.least[i] / self.basis[i, column]

        def slopes(y: Array) -> tuple[float, Array, Array]:
            d = y - start
            value = 0.5 * float(d @ H @ d) - float(g @ d) + 0.5 * float(y[n:] @ y[n:])
            slope, bend = H @ d - g, H.copy()
            slope[n:] += y[n:]
            bend[range(n, len(y)), range(n, len(y))] += 1.0
            for k, body in enumerate(self.bodies):
                at = slice(10 * k, 10 * k + 10)
                more = body.slopes(y[at])
                value += more[0]
                slope[at] += more[1]
                bend[at, at] += more[2]
            return value, slope, bend

        y = np.maximum(start, least)
        value, slope, bend = slopes(y)
        for _ in range(MOST_STEPS):
            held = (y <= least) & (slope > 0.0)
            free = np.flatnonzero(~held)
            scale = 1.0 / np.sqrt(np.diag(bend)[free])
            step = np.zeros(len(y))
            inner = scale[:, None] * bend[np.ix_(free, free)] * scale
            step[free] = -scale * np.linalg.solve(inner, scale * slope[free])
            drop = -float(slope @ step)
            if drop < LEAST_DROP:
                break
            size = 1.0
            while True:
                new = np.maximum(y + size * step, least)
                after = slopes(new)
                if after[0] <= value - 1e-4 * size * drop or size < 1e-9:
                    break
                size *= 0.5
            y, (value, slope, bend) = new, after
        return y

    def jump(self, x: Array) -> None:
        """Put values, in the form of ``x``, into the tree and into the linearisation point."""
        n = self.first
        mass, com, inertia = (a.copy() for a in (self.given.mass, self.given.com, self.given.inertia))
        for k, b in enumerate(self.links):
            own = central(x[10 * k : 10 * k + 10])
            mass[b], com[b], inertia[b] = own[0], own[1:4], moments_matrix(own[4:])
        tables = {name: getattr(self.given, name).copy() for name in ("coulomb", "viscous", "armature")}
        for s, value in zip(self.scalars, x[n:], strict=True):
            table = s.name.split("_", 1)[0]
            if s.label.endswith((" coulomb_Nm", " viscous_Nms_per_rad", " armature_kgm2")):
                tables[table][self.model.joints.index(s.place)] += value
            elif s.name in ("gain", "delay_s", "limit", "zero_rad") or s.name.startswith(
                ("position", "tilt")
            ):
                self.values[s.label] = float(value)
        self.tree = replace(self.given, mass=mass, com=com, inertia=inertia, **tables)

    # --- results

    def zero(self) -> Array:
        """Fitted joint zeros, shape (J,)."""
        return np.array([self.values.get(f"{n} zero", 0.0) for n in self.model.joints])

    def gravity(self) -> Array:
        """Gravity with the fitted tilt, shape (3,)."""
        return np.array(self.problem.parts[0].tree.gravity)

    def coupled(self) -> dict[int, tuple[float, float, float, float]]:
        """Friction, rotor and ratio of coupled drives by their second joint."""
        x = dict(zip((s.label for s in self.scalars), self.x[self.first :], strict=True))
        out = {}
        for j, n in enumerate(self.model.joints):
            ratio = self._coupling(j)
            if ratio:
                coulomb, viscous, rotor = (float(x[f"{n} coupled {ratio:+.0f} {k}"]) for k in range(3))
                out[j] = coulomb, viscous, rotor, ratio
        return out

    def parameters(self) -> Iterator[Parameter]:
        """All parameters with their standard errors."""
        for k, body in enumerate(self.bodies):
            at = slice(10 * k, 10 * k + 10)
            value, given = central(self.x[at]), central(body.given)
            se = _errors(_slope(central, self.x[at]), self.covariance[at, at])
            prior = _errors(_slope(central, body.given), self.prior[at, at])
            place = self.model.model.body(body.body).name
            known = se < DETERMINED * prior
            known[1:] &= known[0]  # centre and inertia are quotients by the mass
            for i, name in enumerate(CENTRAL):
                numbers = float(given[i]), float(value[i]), float(se[i]), float(prior[i])
                yield Parameter(place, name, *numbers, bool(known[i]))
        n = self.first
        slopes = self.scalar_slopes()
        se, prior = (np.sqrt(np.diag(slopes @ x[n:, n:] @ slopes.T)) for x in (self.covariance, self.prior))
        for i, s in enumerate(self.scalars):
            yield self.told(s, float(self.x[n + i]), float(se[i]), float(prior[i]))

    def told(self, s: Scalar, value: float, se: float, prior: float) -> Parameter:
        """A scalar as it is told, from its deviation, and its standard error and prior standard deviation as told."""
        joints = self.model.joints
        slide = s.place in joints and bool(self.model.slides[joints.index(s.place)])
        known, name = se < DETERMINED * prior, parameter_name(s.name, slide=slide)
        return Parameter(s.place, name, float(s.model), float(s.model + value), se, prior, known, s.in_model)

    def servos(self) -> Array | None:
        """Position loops as MJCF holds them, shape (J, 4); None: the fit has none."""
        return None

    def covariances(self) -> Array:
        """Covariance of ``parameters``, in their order, shape (P, P)."""
        n = self.first
        slope = np.zeros_like(self.covariance)
        for k in range(len(self.bodies)):
            at = slice(10 * k, 10 * k + 10)
            slope[at, at] = _slope(central, self.x[at])
        slope[n:, n:] = self.scalar_slopes()
        return slope @ self.covariance @ slope.T

    def scalar_slopes(self) -> Array:
        """Derivatives of the scalars as they are told by their deviations, shape (S, S)."""
        return np.eye(len(self.scalars))

    def combinations(self) -> Iterator[Combination]:
        """Base parameters of masses and rotors: pivoted QR of the columns the logs excite (M. Gautier, ICRA 1991)."""
        n = self.first
        at = np.array(
            [*range(n), *(n + i for i, s in enumerate(self.scalars) if s.name.endswith("armature_kgm2"))]
        )
        f = self.fit[at]
        G = sum((G for G, _ in self.normals), np.zeros((len(self.active),) * 2))[np.ix_(f, f)]
        size = np.sqrt(np.maximum(np.diag(G), 1e-300))
        covariance, prior = self.covariance[np.ix_(at, at)], self.prior[np.ix_(at, at)]
        typical = np.sqrt(np.diag(prior))
        seen = np.flatnonzero(size * typical > BASE * np.max(size * typical))
        eigen, turn = np.linalg.eigh(G[np.ix_(seen, seen)] / np.outer(size[seen], size[seen]))
        root = np.sqrt(np.maximum(eigen, 0.0))[:, None] * turn.T
        # Where columns are alike, rounding would choose, so the first gets a lead.
        order = qr(root * (1.0 - TIE * np.arange(len(seen))), mode="economic", pivoting=True)[-1]
        R = np.linalg.qr(root[:, order])[1]
        rank = int(np.sum(np.abs(np.diag(R)) > DEPENDENT * abs(R[0, 0])))
        beta = np.linalg.solve(R[:rank, :rank], R[:rank, rank:])
        names = [(self.model.model.body(b).name, m) for b in self.links for m in MOMENTS]
        names += [(self.scalars[i].place, self.scalars[i].name) for i in at[n:] - n]
        own = np.concatenate([np.zeros(n), [s.model for s in self.scalars]])
        value, given = ((x + own)[at] for x in (self.x, self.given_x))
        for i in range(rank):
            first, others = seen[order[i]], seen[order[rank:]]
            way = np.zeros(len(value))
            way[first], way[others] = 1.0, beta[i] / size[first] * size[others]
            way[np.abs(way) * typical < SMALL * typical[first]] = 0.0
            terms = {names[k]: float(way[k]) for k in (first, *others) if way[k]}
            se = float(np.sqrt(way @ covariance @ way))
            if len(terms) > 1 and se < DETERMINED * np.sqrt(way @ prior @ way):
                yield Combination(terms, float(way @ given), float(way @ value), se)

    def held_out(self) -> tuple[HeldOut, ...]:
        """Predict each part from the others, with values linearised around those of all parts."""
        out, parts = [], range(len(self.normals))
        nothing = self.given_x - self.at
        for t in parts:
            others = [k for k in parts if k != t] or [t]
            values = self.solved(others)[0] - self.at
            sides = self.left(t, nothing, free=False), self._plain(t, others), self.left(t, values)
            rows = self.rows[t]
            variance = self.variance if self.problem.sensors is None else self.problem.sensors
            noise = np.sqrt(np.sum(rows * variance, axis=1) / rows.sum(axis=1)) * self.series[t].unit
            torque = np.sqrt(np.mean(self.trials.signals[t].torque ** 2, axis=0))
            plain, least, best = (self._wide(np.sqrt(np.mean(left**2, axis=0))) for left in sides)
            out.append(HeldOut(self.trials.names[t], plain, least, best, self._wide(noise), torque))
        return tuple(out)

    def left(self, t: int, values: Array, *, free: bool = True) -> Array:
        """Residual torque of a part at given values; friction at rest, which nobody predicts, is fitted if ``free``."""
        x = np.zeros(len(self.active))
        x[self.fit] = values
        if free:
            (G, b), at = self.normals[t], self.rests
            x[at] = np.linalg.solve(G[np.ix_(at, at)] + np.diag(1.0 / self.spread[at]), (b - G @ x)[at])
        return self.series[t].left(x)

    def _plain(self, t: int, others: Sequence[int]) -> Array:
        """The same with ordinary least squares: ten parameters a link, friction, rotor and offset a joint."""
        names = ("coulomb_Nm", "viscous_Nms_per_rad", "armature_kgm2", "offset_Nm")
        n = self.first
        at = self.fit[[*range(n), *(n + i for i, s in enumerate(self.scalars) if s.name in names)]]
        scale = np.sqrt(np.mean(np.concatenate([self.trials.signals[k].torque for k in others]) ** 2, axis=0))
        scale = np.maximum(scale[list(self.known)], 1e-12)
        A = np.concatenate(
            [(self.series[k].columns[:, :, at] / scale[:, None]).reshape(-1, len(at)) for k in others]
        )
        y = np.concatenate([(self.series[k].residual / scale).ravel() for k in others])
        size = np.linalg.norm(A, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        values = np.linalg.lstsq(A / size, y, rcond=BASE)[0] / size
        x = np.zeros(len(self.active))
        x[at] = values
        return self.left(t, x[self.fit])

    def _wide(self, sizes: Array) -> Array:
        out = np.zeros(len(self.model.joints))
        out[list(self.known)] = sizes
        return out

    def notes(self) -> Iterator[str]:
        """Sentences on what the fit holds fixed."""
        if any(self.gain_prior(j) == GAIN for j in self.known):
            yield (
                "The mean torque gain is held at 1: without a known weight, torques determine masses, inertias and "
                "friction only up to a common factor."
            )
        if self.mount is not None:
            yield "The base is mounted another way than in the model: gravity is turned, even for the given one."
        for motor in self.trials.motors:
            yield motor.sentence(self.model.joints[motor.joint])
        for b in dict.fromkeys(map(int, self.given.joint_body)):
            if not any(welded(self.given, k, b) for k in self.links):
                name = self.model.model.body(b).name
                yield f"Link {name} has no mass in the model, so its inertial parameters are not fitted."


def _errors(slope: Array, covariance: Array) -> Array:
    """Standard errors of linear functions of values with a covariance."""
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slope, covariance, slope)))


def _slope(of: Callable[[Array], Array], x: Array) -> Array:
    """Derivatives of a function by central differences, shape (outputs, inputs)."""
    steps = 1e-5 * np.maximum(np.abs(x), 1e-6)
    return np.column_stack([
        (of(x + step * e) - of(x - step * e)) / (2.0 * step) for step, e in zip(steps, np.eye(len(x)), strict=True)
    ])  # fmt: skip
