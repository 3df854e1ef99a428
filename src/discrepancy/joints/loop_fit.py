"""Calibration of robots whose drives tell no torque: rows are positions in the closed loop (``closed_loop``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from discrepancy.joints.closed_loop import ClosedLoop, cells_of
from discrepancy.joints.fit import DETERMINED, FREE_GAIN, GAIN, LEARNING, Fit, HeldOut, Parameter, Scalar
from discrepancy.joints.forecast import Forecasts, errors, machine
from discrepancy.joints.friction import AT_REVERSALS, deviations, polynomial
from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import FORM, MOMENTS, JointProblem
from discrepancy.joints.quantities import described
from discrepancy.joints.servo import with_torques
from discrepancy.joints.signals import REST
from discrepancy.joints.trials import Trials
from estimator.arrays import Array
from mocobot_logs.joints.asked_torque import with_asked_torques
from mocobot_logs.joints.joint_log import JointLog

LATE_S = 0.02
"""Prior standard deviation of the delay of commands [s]. Chosen: that of a busy bus."""
WIDE = 1.5
"""Least factor on standard errors that is told. Chosen: ten values of two parts scatter by less than that."""
FULL = LEARNING + 2
"""Steps that are taken in full; the k-th after them counts 1 / (k + 1). Chosen: two with the noise held."""
LIMIT = 0.1
"""Prior standard deviation of the relative error of a drive's largest torque. Chosen: that of a data sheet."""
REST_SHARE = 0.05
"""Least friction at rest over the rms torque. Chosen."""


def with_gains(model: SerialModel, logs: Sequence[JointLog]) -> tuple[JointLog, ...]:
    """Give loops of unknown position gain a first one: that with which the model's masses explain the motion best.

    Args:
        model: the robot as described.
        logs: logs of one robot with position commands and no torques.

    Raises:
        InputError: the errors of the positions do not go with the torque that the model asks for.
    """
    if not any(
        log.by_command and log.drive.gain_of == "torque" and log.drive.gain_free[:, 0].any() for log in logs
    ):
        return tuple(logs)
    asked = []
    for log in logs:
        assert log.command is not None
        asked.append(
            replace(log, torque=None, drive=replace(log.drive, duty=log.command - log.q, supply_V=None))
        )
    motors = with_torques(model, asked)[1]
    out = []
    for log in logs:
        gain = log.drive.position_gain.copy()
        for motor in motors:
            if log.drive.gain_free[motor.joint, 0]:
                gain[motor.joint] = motor.torque_per_unit
        out.append(with_asked_torques(replace(log, drive=replace(log.drive, position_gain=gain))))
    return tuple(out)


class LoopFit(Fit):
    """The fit around its current values and motion.

    Attributes:
        loops: closed loops of the runs.
        widened: factor on the standard errors by quantity, see ``widen``.
        forecasts: what ``held_out`` keeps of the first part.
    """

    late_s = LATE_S
    forecasts: Forecasts | None = None

    def __init__(self, model: SerialModel, trials: Trials) -> None:
        self.loops = [ClosedLoop.of(s, fast=True) for s in trials.runs]
        self.widened: dict[str, float] = {}
        super().__init__(model, replace(trials, noise=(), kept=()))
        names = [f"payload {model.model.body(b).name} {m}" for b in self.links for m in MOMENTS]
        self.options = replace(self.options, wanted=frozenset([*names, *(s.label for s in self.scalars)]))

    def rough(self, j: int) -> float:
        """Factor within which the position gain of a joint is known."""
        return max(float(loop.signals.log.drive.gain_within[j, 0]) for loop in self.loops)

    def gain_prior(self, j: int) -> float:
        """Prior standard deviation of the relative error of a joint's gains."""
        return GAIN if self.rough(j) == 1.0 else FREE_GAIN

    def more_scalars(self, j: int) -> Iterator[Scalar]:
        """The largest torque of a drive that reaches it."""
        n, signals = self.model.joints[j], self.trials.runs
        if any(s.by_limit is not None and s.by_limit[:, j].any() for s in signals):
            yield Scalar(f"{n} limit", n, "limit", 0.0, LIMIT, in_model=False)

    def least_damping(self, j: int) -> float:
        """Least viscous friction of a joint: below none where the loop's velocity gain may be less than told."""
        return min(float(loop.damping[j]) for loop in self.loops)

    def linear(self) -> JointProblem:
        """Build the problem around the present motion, with rows of the motion that the filter predicts in the end."""
        late, scale = (self.each(what) for what in ("delay_s", "scale"))
        for loop in self.loops:
            loop.limit = loop.plain[:, 3] * (1.0 + self.each("limit"))
        runs = tuple(loop.seen(self.model, late) for loop in self.loops)
        pairs = []
        for loop, s in zip(self.loops, runs, strict=True):
            dry = np.maximum(self.tree.coulomb, REST_SHARE * np.sqrt(np.mean(s.torque**2, axis=0)))
            pairs.append((loop, loop.filtered(s, self.with_friction(self.tree), scale, dry, REST * s.slow)))
        self.options = replace(self.options, noise=None, loops=pairs)
        parts = []
        for k, at in self.trials.parts:
            share = len(runs[k].time) / len(self.trials.runs[k].time)
            parts.append((k, slice(round(at.start * share), round(at.stop * share))))
        self.trials = replace(self.trials, runs=runs, parts=tuple(parts))
        problem = super().linear()
        if not self.options.wanted:  # it only tells which parameters there are
            return problem
        residual = problem.shifted(problem.residual, self.values, -1.0)
        if self.steps < LEARNING:  # the filter's predictions are far off
            problem.cells = cells_of(pairs, problem.residual, problem.series)
            return problem
        predicted = [
            loop.seen(self.model, late, loop.predicted(filtered, own))
            for (loop, filtered), own in zip(pairs, residual, strict=True)
        ]
        self.trials = replace(self.trials, runs=tuple(predicted))
        columns = super().linear()
        self.trials = replace(self.trials, runs=runs)
        problem.cells = cells_of(pairs, columns.shifted(residual, self.values), columns.series)
        return problem

    def step(self) -> float:
        """Fit around the current values and motion, and move both; return the largest step in standard errors.

        Rests and drives at their limits come and go as the motion moves, which full steps would do for ever. So steps
        shrink in the end (H. Robbins and S. Monro, "A stochastic approximation method", 1951).
        """
        begun = self.x, [(loop.q, loop.dq) for loop in self.loops]
        moved = super().step()
        parts = range(len(self.normals))
        self.friction = self.deviating(parts)
        found = {self.problem.labels[i]: value for i, value in self.explained(parts)[1]}
        lacking = self.problem.shifted(self.problem.residual, found, -1.0)
        every = [
            (loop, filtered, own) for (loop, filtered), own in zip(self.options.loops, lacking, strict=True)
        ]
        for loop, filtered, own in every:
            loop.move(filtered, own)
            if self.steps <= LEARNING:
                loop.learn(filtered, own)
        share = 1.0 / (1 + max(self.steps - FULL, 0))
        self.x = begun[0] + share * (self.x - begun[0])
        for loop, (q, dq) in zip(self.loops, begun[1], strict=True):
            loop.q, loop.dq = q + share * (loop.q - q), dq + share * (loop.dq - dq)
        self.jump(self.x)
        return share * moved if self.steps > LEARNING else np.inf

    def widen(self) -> None:
        """Widen standard errors by the scatter between parts, by quantity (R. T. Birge, Phys. Rev. 40, 1932).

        Values of one part differ from those of all by as much as their covariances differ, if the model holds. Where
        its laws do not, such as those of friction, other motions give other values.
        """
        parts, n = range(len(self.normals)), self.first
        names = [s.name for s in self.scalars]
        if len(parts) < 2:
            return
        squares = []
        for t in parts:
            x, covariance = self.solved([t])
            wider = np.diag(covariance - self.covariance)[n:]
            squares.append((x - self.x)[n:] ** 2 / np.maximum(wider, 1e-3 * np.diag(covariance)[n:]))
        each, wide = np.mean(squares, axis=0), np.ones(len(self.x))
        for name in dict.fromkeys(names):
            at = [i for i, own in enumerate(names) if own == name]
            self.widened[name] = max(1.0, float(np.sqrt(np.mean(each[at]))))
            wide[n + np.array(at)] = self.widened[name]
        self.covariance = self.covariance * np.outer(wide, wide)

    def each(self, what: str) -> Array:
        """A value of the linearisation point for every joint, shape (J,)."""
        return np.array([self.values.get(f"{n} {what}", 0.0) for n in self.model.joints])

    def told(self, s: Scalar, value: float, se: float, prior: float) -> Parameter:
        """A scalar as it is told; roughly known gains by their values, which a gain's error divides."""
        j = self.model.joints.index(s.place) if s.place in self.model.joints else -1
        if s.name == "delay_s":
            told = float(np.nan_to_num(self.loops[0].signals.log.drive.delay_s[j]))
            s = replace(s, name="command_delay_s", model=told)
        if s.name == "limit":
            name = "limit_N" if self.model.slides[j] else "limit_Nm"
            most, value = (float(x[j, 3]) for x in (self.loops[0].plain, self.servos()))
            return Parameter(s.place, name, most, value, se, prior, se < DETERMINED * prior, in_model=False)
        if s.name != "gain" or self.rough(j) == 1.0:
            return super().told(s, value, se, prior)
        gain = float(self.loops[0].plain[j, 0])
        name = "position_gain_N_per_m" if self.model.slides[j] else "position_gain_Nm_per_rad"
        known = se < DETERMINED * prior
        return Parameter(s.place, name, gain, gain / (1.0 + value), se, prior, known, in_model=False)

    def scalar_slopes(self) -> Array:
        """As for torques; an error of a gain divides gain and limit."""
        out, at = super().scalar_slopes(), {s.label: i for i, s in enumerate(self.scalars)}
        for s in self.scalars:
            if s.name not in ("gain", "limit"):
                continue
            j = self.model.joints.index(s.place)
            i, k, error = at[s.label], at[f"{s.place} scale"], 1.0 + self.each("scale")[j]
            if s.name == "limit":
                out[i, i], out[i, k] = self.loops[0].plain[j, 3] / error, -self.servos()[j, 3] / error
            elif self.rough(j) != 1.0:
                out[i, i] = -self.loops[0].plain[j, 0] / error**2
        return out

    def servos(self) -> Array:
        """Position gain, velocity gain with negative damping, torque added, and largest torque, shape (J, 4)."""
        kp, kd, limit, _ = self.loops[0].gains(1)
        true = 1.0 / (1.0 + self.each("scale"))
        damping = kd * true + np.minimum(self.numbers().viscous, 0.0)
        return np.column_stack([kp * true, damping, -self.offset * true, limit * true])

    @property
    def offset(self) -> Array:
        """Torque that the loop's formula tells too much, shape (J,)."""
        own = dict(zip((s.label for s in self.scalars), self.x[self.first :], strict=True))
        return np.array([own.get(f"{n} offset_Nm", 0.0) for n in self.model.joints])

    def numbers(self) -> Tree:
        """The tree with the fitted lengths and gravity, too, and with friction as MJCF holds it."""
        own = {
            name: getattr(self.tree, name)
            for name in ("mass", "com", "inertia", "armature", "coulomb", "viscous")
        }
        return self.with_friction(replace(self.problem.parts[0].tree, **own))

    def with_friction(self, tree: Tree) -> Tree:
        """A tree with the friction of joints that deviate from Coulomb and viscous friction."""
        coulomb, viscous, drag = (a.copy() for a in (tree.coulomb, tree.viscous, tree.drag))
        for j, law in self.friction.items():
            coulomb[j], viscous[j], drag[j] = law[0], law[1], self.given.drag[j] + law[2:]
        return replace(tree, coulomb=coulomb, viscous=viscous, drag=drag)

    def deviating(self, parts: Sequence[int]) -> dict[int, Array]:
        """Friction of the joints that deviate from Coulomb and viscous friction, from some parts, as ``friction``."""
        out = dict[int, Array]()
        if not len(self.laws):
            return out
        x, every = self.explained(parts)
        size = {self.problem.labels[k]: value for k, value in every}
        own = dict(zip((s.label for s in self.scalars), x[self.first :], strict=True))
        tree = self.problem.parts[0].tree
        for j in self.known:
            n, signals = self.model.joints[j], self.problem.joints[j]
            coulomb = self.given.coulomb[j] + own[f"{n} coulomb_Nm"]
            viscous = self.given.viscous[j] + own[f"{n} viscous_Nms_per_rad"]
            torque = [coulomb * s.direction + viscous * s.v for s in signals]
            forms = deviations(signals, float(tree.coulomb[j]), float(tree.viscous[j]), FORM, servo=True)
            told = {f"{n} form {i}": form for i, form in enumerate(forms) if i not in AT_REVERSALS}
            told = {label: form for label, form in told.items() if label in size}
            for label, form in told.items():
                torque = [t + size[label] * f for t, f in zip(torque, form, strict=True)]
            if told:
                out[j] = polynomial(signals, torque, self.least_damping(j))
        return out

    def held_out(self) -> tuple[HeldOut, ...]:
        """Forecast the positions of each part from its commands, with values from the others."""
        parts, out, before = range(len(self.normals)), [], self.x
        none = np.zeros(len(self.model.joints))
        plain = machine(self.model, self.given, self.given)
        for t in parts:
            k, steps = self.trials.parts[t]
            loop = self.loops[k]
            self.x = self.solved([o for o in parts if o != t] or [t])[0]
            self.jump(self.x)
            self.friction = self.deviating([o for o in parts if o != t] or [t])
            fitted, zero, late = (
                machine(self.model, self.given, self.numbers()),
                self.zero(),
                self.each("delay_s"),
            )
            pair = (plain, loop.plain, none, none), (fitted, self.servos(), zero, late)
            off, *whole = (
                [errors(m, self.model, loop, gains, at, by, run) for m, gains, at, by in pair]
                for run in (steps, slice(steps.start, steps.stop, len(loop.q)))[: 1 + (t == 0)]
            )
            if whole:
                self.forecasts = Forecasts.of(self.trials.names[t], loop, steps, off, *whole)
            model, best = (np.sqrt(np.nanmean(x**2, axis=0)) for x in off)
            rows = loop.measured[steps.start // loop.every : steps.stop // loop.every]
            read, size = np.sqrt(loop.reading), np.nanstd(rows, axis=0)
            out.append(HeldOut(self.trials.names[t], model, none + np.nan, best, read, size))
        self.x = before
        self.jump(before)
        self.friction = self.deviating(parts)
        return tuple(out)

    def notes(self) -> Iterator[str]:
        """Sentences on what the fit holds fixed or cannot tell apart."""
        yield from super().notes()
        drive = self.loops[0].signals.log.drive
        names = [
            n for n, factor in zip(self.model.joints, drive.gain_within[:, 1], strict=True) if factor > 1.0
        ]
        if names:
            yield (
                f"Velocity gain and viscous friction of {', '.join(names)} have the same effect: only their sum is "
                "determined. The viscous friction is told for the velocity gain of the map, 0 where it is free, which "
                "is off by the same factor as the position gain."
            )
        if self.friction:
            names = [self.model.joints[j] for j in self.friction]
            yield (
                f"Friction of {', '.join(names)} deviates from Coulomb and viscous friction. as_found.xml has Coulomb "
                "friction and damping of third degree in the speed, the table the nearest Coulomb and viscous friction."
            )
        wide = {name: factor for name, factor in self.widened.items() if factor > WIDE}
        if wide:
            own = {"delay_s": "command_delay_s", "limit": "limit_Nm"}
            told = {described(own.get(n, n))[0]: x for n, x in wide.items()}
            listed = ", ".join(f"{name} {factor:.1f}" for name, factor in told.items())
            yield (
                "Parts of the logs differ by more than their standard errors, so something acts that no parameter is. "
                f"Standard errors count that scatter; they are wider by a factor of: {listed}."
            )
        jitter = max(float(np.sqrt(loop.jitter).max()) for loop in self.loops)
        if jitter > 1e-4:
            yield f"Positions are as if they were read up to {1e3 * jitter:.1f} ms (rms) beside their stamps."
