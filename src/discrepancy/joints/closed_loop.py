"""Positions of drives that tell no torque: the likelihood of the encoders' readings in the closed position loop.

The torque that a position loop asks for depends on the true motion, which the encoders tell with noise. So the motion
on a fine grid is estimated together with the parameters: the loop is linearised around it, deviations are filtered
(``loop_filter``), and the rows of the linear problem are the whitened innovations of the positions. The motion obeys
the implicit midpoint rule, and torques that no parameter explains act as noise of learnt size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, prev_fast_len
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from discrepancy.evidence.cells import Bands, Cells, Series
from discrepancy.joints import friction
from discrepancy.joints.loop_filter import Filtered, LinearLoop, cost
from discrepancy.joints.mechanics import Tree, inverse_torque, torque_of
from discrepancy.joints.model import SerialModel
from discrepancy.joints.signals import REST, STEP_M, STEP_RAD, Signals
from discrepancy.joints.trials import Trials
from estimator.arrays import Array
from estimator.filtering import low_pass
from mocobot_logs.joints.joint_log import JointLog

STEP_S = 2e-3
"""Longest step of the grid [s]. Derived: the midpoint rule errs by a thousandth at 10 Hz."""
MATRICES_HZ = 100.0
"""Rate at which inertias and stiffnesses of the arm are computed. Chosen: ten times the fastest motion."""
SHARE, MOTION_HZ = 0.4, 20.0
"""Highest frequency of the motion that readings tell, over the log's rate and at most [Hz]. Chosen."""
FAR = 1.0
"""Least deviation of a model from the motion at which it runs away without readings [rad or m]. Chosen."""
MOVES, FINE_HZ, FINE_SHARE = 4, 160.0, 0.2
"""Steps that estimate the motion for a diagnosis; least rate of its signals [Hz], and their cut-off over that rate.
Chosen: friction turns round within the period of a slower log."""
DELAY_STEP_S = 1e-3
"""Half the step of the derivative by the delay [s]. Chosen: commands are held for longer."""
START_RAD, START_RAD_PER_S = 0.02, 1.0
"""Standard deviations of the first state. Chosen: far above the encoders' errors."""
REST_S = 0.05
"""Correlation time of friction at rest [s], where it is any torque up to the Coulomb friction. Chosen."""
FIRST_SHARE, FIRST_JITTER_S, LARGEST, LEAST_RAD, LEAST_NM = 0.5, 1e-4, 10.0, 1e-6, 1e-6
"""First guesses of the torque that nothing explains, over the rms torque, and of the stamps' jitter [s]; the largest
change of a variance's logarithm in one step; the least error of a reading [rad] and rms torque [N m]. Chosen."""
BANDS = np.array([0.0, 0.02, 0.04, 0.08, 0.15, 0.25, 0.35, 0.5])
"""Edges of the bands of the innovations over the log's rate."""
CHUNK = 64
"""Columns that are filtered at once."""
Course = tuple[Array, Array, Array]


def commanded(log: JointLog) -> bool:
    """Whether positions and commands are all that a log tells of its drives, in torque per error."""
    drive = log.drive
    known = log.command is not None and np.isfinite(log.command).any(axis=0).all()
    return bool(known and log.by_command and drive.command == "position" and drive.gain_of == "torque")


@dataclass(eq=False)
class ClosedLoop:
    """One run of a log on a grid of N steps: the estimated motion and the noise.

    Attributes:
        signals: the run as the diagnosis smooths it.
        first: sample of the log at the first grid point.
        every: steps of the grid for each sample.
        q, dq: motion at the grid points, shape (N + 1, J).
        measured: positions read, NaN where there is none, shape (M, J).
        reading: variance of the readings at rest, shape (J,) [rad^2].
        jitter: variance of the time at which a position was read, shape (J,) [s^2].
        torque: variance of unexplained torque over one second, shape (J,) [(N m)^2 s].
        limit: largest torque of the drives, inf where they have none, shape (J,) [N m or N].
    """

    signals: Signals
    first: int
    every: int
    q: Array
    dq: Array
    measured: Array
    reading: Array
    jitter: Array
    torque: Array
    limit: Array

    @classmethod
    def of(cls, s: Signals, *, fast: bool = False) -> ClosedLoop:
        """Begin with the low-passed positions; ``fast`` drops a few last samples, so that transforms are fast."""
        log = s.log
        first, last = (int(np.argmin(np.abs(log.time - t))) for t in (s.time[0], s.time[-1]))
        last = first + (prev_fast_len(last + 1 - first, real=True) or 1) - 1 if fast else last
        every = int(np.ceil(log.period_s / STEP_S - 1e-9))
        here = slice(first, last + 1)
        way = CubicSpline(log.time, low_pass(log.q, log.rate_hz, min(MOTION_HZ, SHARE * log.rate_hz)), axis=0)
        time = log.time[first] + np.arange((last - first) * every + 1) * log.period_s / every
        measured = np.where(log.usable[here, None], log.q[here], np.nan)
        noise = np.maximum(log.position_step**2 / 12.0 + LEAST_RAD**2, _reading(log))
        size = np.mean(s.torque**2, axis=0) + LEAST_NM**2
        return cls(
            s, first, every, way(time), way(time, 1), measured, noise,
            np.full(len(size), FIRST_JITTER_S**2), FIRST_SHARE**2 * size * log.period_s,
            _limits(log),
        )  # fmt: skip

    @property
    def damping(self) -> Array:
        """Least viscous friction, shape (J,): less than none where the loop's velocity gain may be less than told."""
        d = self.signals.log.drive
        told, within = np.nan_to_num(d.velocity_gain), d.gain_within[:, 1]
        return -told * (1.0 - 1.0 / within)

    @property
    def least(self) -> Array:
        """Least variance of the readings: that of their rounding, shape (J,)."""
        return self.signals.log.position_step**2 / 12.0 + LEAST_RAD**2

    @property
    def step_s(self) -> float:
        """Step of the grid [s]."""
        return self.signals.log.period_s / self.every

    @property
    def middle(self) -> Course:
        """Positions, velocities and accelerations at the middles of the steps, shape (N, J) each."""
        h = self.step_s
        return 0.5 * (self.q[1:] + self.q[:-1]), np.diff(self.q, axis=0) / h, np.diff(self.dq, axis=0) / h

    def seen(self, model: SerialModel, late: Array, motion: Course | None = None) -> Signals:
        """A motion and the torque that the loop asks for in it, at the middles of the steps.

        Args:
            model: the robot as described.
            late: delay of the commands, shape (J,) [s].
            motion: positions, velocities and accelerations there, shape (N, J) each; None: the estimated motion.
        """
        q, dq, ddq = motion or self.middle
        log, h = self.signals.log, self.step_s
        time = log.time[self.first] + (np.arange(len(q)) + 0.5) * h
        (command, added), (before, _), (after, _) = (
            self.told(late + d) for d in (0.0, -DELAY_STEP_S, DELAY_STEP_S)
        )
        kp, kd, limit, on = self.gains(len(q))
        asked = kp * (command - q) - kd * dq + added
        torque = np.clip(asked, -limit, limit) * on
        free = (np.abs(asked) < limit) * on
        by_delay = -free * kp * (after - before) / (2.0 * DELAY_STEP_S)
        by_limit = -np.sign(asked) * np.where(np.abs(asked) < limit, 0.0, _limits(log)) * on
        ones = np.ones(q.shape, dtype=bool)
        return replace(
            self.signals, rate_hz=1.0 / h, time=time, q=q, dq=dq, ddq=ddq, torque=torque, usable=ones,
            inverse=inverse_torque(model.model, q, dq, ddq), by_delay=by_delay, by_limit=by_limit, by_command=None,
            enabled=None, spoilt=None,
        )  # fmt: skip

    def thinned(self, seen: Signals) -> Signals:
        """Signals of ``seen`` at a lower rate, with what comes with the commands."""
        thin = max(1, int(seen.rate_hz / FINE_HZ))
        kp, rate = self.gains(1)[0], seen.rate_hz
        names = ("q", "dq", "ddq", "torque", "inverse", "by_delay")
        every = {name: getattr(seen, name) for name in names}
        every["by_command"] = kp * self.told(np.zeros(len(kp)))[0]
        cutoff = FINE_SHARE * rate / thin
        return replace(
            seen, rate_hz=rate / thin, time=seen.time[::thin], usable=seen.usable[::thin],
            **{name: low_pass(x, rate, cutoff)[::thin] for name, x in every.items()},
        )  # fmt: skip

    def gains(self, steps: int) -> tuple[Array, Array, Array, Array]:
        """Gains on position and velocity, largest torque, shape (J,) each, and whether the drives are on, (N, 1)."""
        log = self.signals.log
        d = log.drive
        on = np.ones((steps, 1))
        if log.enabled is not None:
            on[:, 0] = log.enabled[self.first + np.arange(steps) // self.every]
        return d.position_gain, np.nan_to_num(d.velocity_gain), self.limit, on

    @property
    def plain(self) -> Array:
        """The loops as the log's map has them: gains, no torque added, and limit, shape (J, 4)."""
        kp, kd, _, _ = self.gains(1)
        return np.column_stack([kp, kd, np.zeros(len(kp)), _limits(self.signals.log)])

    def told(self, late: Array) -> tuple[Array, Array]:
        """Commanded positions and torques beside them, means over each step, shape (N, J) each."""
        log, d = self.signals.log, self.signals.log.drive
        assert log.command is not None
        added = np.zeros((len(self.q) - 1, len(late)))
        for told, factor in ((d.feedforward, 1.0), (d.command_velocity, np.nan_to_num(d.velocity_gain))):
            if told is not None:
                added += factor * self._mean(np.nan_to_num(told), late)
        return self._mean(log.command, late), added

    def _mean(self, told: Array, late: Array) -> Array:
        """Mean over each step of what a drive was told, held from sample to sample or interpolated, shape (N, J)."""
        log = self.signals.log
        late = late + np.nan_to_num(log.drive.delay_s)
        edges = log.time[self.first] + np.arange(len(self.q)) * self.step_s
        out = np.empty((len(edges) - 1, told.shape[1]))
        for j, own in enumerate(late):
            if log.drive.held:
                stamps = np.append(log.time, log.time[-1] + log.period_s)
                whole = np.append(0.0, np.cumsum(told[:, j]) * log.period_s)
                at = edges - own
                passed = np.interp(at, stamps, whole) + np.minimum(at - stamps[0], 0.0) * told[0, j]
                out[:, j] = np.diff(passed) / self.step_s
            else:
                out[:, j] = np.interp(edges[:-1] + 0.5 * self.step_s - own, log.time, told[:, j])
        return out

    def filtered(self, s: Signals, tree: Tree, scale: Array, dry: Array, slow: Array) -> Filtered:
        """Filter of the loop linearised around the motion.

        Args:
            s: the motion at the middles of the steps.
            tree: kinematic tree with the present numbers.
            scale: errors of the torque gains, shape (J,).
            dry: largest torque of friction at rest, shape (J,).
            slow: speed below which a joint may rest, shape (J,).
        """
        h, J, N = self.step_s, len(scale), len(s.time)
        kp, kd, limit, on = self.gains(N)
        free = (np.abs(s.torque) < limit) * on
        thin = max(1, round(s.rate_hz / MATRICES_HZ))
        at = np.arange(0, N, thin)
        inertia, damping, stiffness = (
            x * (1.0 + scale)[:, None] for x in derivatives(tree, s.q[at], s.dq[at], s.ddq[at])
        )
        K = stiffness[np.arange(N) // thin] + np.eye(J) * (free * kp)[:, None, :]
        v = np.abs(s.dq)
        rubbing = tree.viscous + 2.0 * tree.drag[:, 0] * v + 3.0 * tree.drag[:, 1] * v**2
        D = damping[np.arange(N) // thin] + np.eye(J) * (free * kd + (1.0 + scale) * rubbing)[:, None, :]
        M = inertia[np.arange(N) // thin]
        A, B = midpoint(M, D, K, h)
        Q = np.tile(self.torque / h, (N, 1))
        for j in range(J):
            for a, b in friction.rests(s.dq[:, j], h, slow[j]):
                Q[a:b, j] += (0.5 * dry[j]) ** 2 * REST_S / h
        speed = self.dq[:: self.every] ** 2
        R = np.where(
            np.isfinite(self.measured).all(axis=1, keepdims=True), self.reading + self.jitter * speed, np.inf
        )
        start = np.repeat([START_RAD**2, START_RAD_PER_S**2], J)
        return Filtered.of(LinearLoop(A, B, Q, R, self.every, start))

    @property
    def off(self) -> Array:
        """Measured positions minus the motion, 0 where there is none, shape (M, J)."""
        return np.nan_to_num(self.measured - self.q[:: self.every])

    def predicted(self, filtered: Filtered, lacking: Array) -> Course:
        """The motion as readings up to each step tell it, as ``middle``.

        Columns of this motion do not depend on the noise of later readings. In those of the smoothed motion, that noise
        would go with the innovations and make delays too large and inertias too small.

        Args:
            filtered: filter around the present motion.
            lacking: torque that the model lacks there, shape (N, J).
        """
        begin, end = filtered.predicted(lacking, self.off)
        (q, dq, ddq), J, h = self.middle, self.q.shape[1], self.step_s
        middle, rate = 0.5 * (begin + end), (end - begin) / h
        return q + middle[:, :J], dq + rate[:, :J], ddq + rate[:, J:]

    def learn(self, filtered: Filtered, lacking: Array) -> None:
        """Maximise the likelihood of each joint by the variances of reading, jitter and unexplained torque.

        Deviations of other joints are neglected.

        Args:
            filtered: filter around the present motion.
            lacking: torque that the model lacks there, shape (N, J).
        """
        loop, J = filtered.loop, self.q.shape[1]
        speed, off = (np.ascontiguousarray(x.T) for x in (self.dq[:: self.every] ** 2, self.off))
        for j in range(J):
            at = [j, J + j]
            A, B = (np.ascontiguousarray(x) for x in (loop.A[:, at][:, :, at], loop.B[:, at, j]))
            rest, start = loop.Q[:, j] - self.torque[j] / self.step_s, loop.start[at]
            told, torque = (np.ascontiguousarray(x[:, j]) for x in (loop.R, lacking))
            own = A, B, rest, told, speed[j], off[j], torque, start
            self.reading[j], self.jitter[j], self.torque[j] = self._likeliest(j, own)

    def _likeliest(self, j: int, own: tuple[Array, ...]) -> Array:
        """Variances of reading, jitter and torque that maximise the likelihood of one joint, shape (3,)."""
        A, B, rest, told, speed, off, lacking, start = own
        now = np.log([self.reading[j], self.jitter[j], self.torque[j]])
        most, least = now + LARGEST, np.maximum(now - LARGEST, [np.log(self.least[j]), -np.inf, -np.inf])

        def left(x: Array) -> float:
            read, jitter, torque = np.exp(np.clip(x, least, most))
            R = np.where(np.isfinite(told), read + jitter * speed, np.inf)
            return float(cost((A, B, rest + torque / self.step_s), R, self.every, start, lacking, off))

        simplex = now + np.vstack([np.zeros(3), 2.0 * np.eye(3)])
        options = {"initial_simplex": simplex, "xatol": 0.02, "fatol": 0.1}
        best = minimize(left, now, method="Nelder-Mead", options=options)
        return np.exp(np.clip(best.x, least, most))

    def move(self, filtered: Filtered, lacking: Array) -> None:
        """Move the motion to its likeliest course, above ``MOTION_HZ`` to that of the model if it stays near.

        Noise in the motion would make inertias and friction too small; the model tells what friction does at reversals.

        Args:
            filtered: filter around the present motion.
            lacking: torque that the model lacks there, shape (N, J).
        """
        J, lacking = self.q.shape[1], np.ascontiguousarray(lacking)
        rate, cutoff = 1.0 / self.step_s, min(MOTION_HZ, SHARE * self.signals.log.rate_hz)
        blind = replace(filtered, gain=np.zeros_like(filtered.gain), root=np.zeros_like(filtered.root))
        modelled, way = blind.smoothed(lacking, self.off), filtered.smoothed(lacking, self.off)
        if np.abs(modelled[:, :J]).max() < FAR:
            way = modelled + low_pass(way - modelled, rate, cutoff)
            self.q, self.dq = self.q + way[:, :J], self.dq + way[:, J:]
        else:
            self.q, self.dq = (low_pass(x, rate, cutoff) for x in (self.q + way[:, :J], self.dq + way[:, J:]))


def estimated(model: SerialModel, trials: Trials) -> Trials:
    """Trials whose motion and torques are those of the closed loop's likeliest course; as they are unless commanded.

    Noise of positions is in the torque that a loop's formula tells and in every column alike. That reads as a torque
    whose scale is off, so the motion is smoothed with the model first.

    Args:
        model: the robot as described.
        trials: smoothed logs.
    """
    if not all(commanded(s.log) for s in trials.runs):
        return trials
    runs, none = [], np.zeros(len(model.joints))
    for s in trials.runs:
        loop, tree = ClosedLoop.of(s), s.tree
        seen = loop.seen(model, none)
        for _ in range(MOVES):
            side = [
                friction.direction(v, loop.step_s, slow)
                for v, slow in zip(seen.dq.T, REST * s.slow, strict=True)
            ]
            lacking = seen.torque - seen.inverse - tree.coulomb * np.transpose(side) - tree.viscous * seen.dq
            filtered = loop.filtered(seen, tree, none, tree.coulomb, REST * s.slow)
            loop.move(filtered, lacking)
            loop.learn(filtered, lacking)
            seen = loop.seen(model, none)
        runs.append(loop.thinned(seen))
    parts = []
    for k, at in trials.parts:
        share = len(runs[k].time) / len(trials.runs[k].time)
        parts.append((k, slice(round(at.start * share), round(at.stop * share))))
    return replace(trials, runs=tuple(runs), parts=tuple(parts), noise=(), kept=())


def _limits(log: JointLog) -> Array:
    """Largest torque of each drive by the map, inf where it tells none, shape (J,)."""
    return np.where(np.isnan(log.drive.limit), np.inf, log.drive.limit)


def _reading(log: JointLog) -> Array:
    """Variance of the readings' white noise, from fourth differences, shape (J,)."""
    white = np.diff(log.q, 4, axis=0)
    # A squared normal variable has the median 0.455; the squared binomial coefficients of order 4 add up to 70.
    return np.median(white**2, axis=0) / 0.455 / 70.0


def midpoint(M: Array, D: Array, K: Array, h: float) -> tuple[Array, Array]:
    """Steps A and B of M x'' + D x' + K x = u by the implicit midpoint rule, see ``loop_filter``.

    Args:
        M, D, K: inertia, damping and stiffness of each step, shape (N, J, J).
        h: step [s].
    """
    N, J = M.shape[:2]
    inner = np.linalg.inv(M + 0.5 * h * D + 0.25 * h**2 * K)
    kept, back = inner @ (M - 0.5 * h * D - 0.25 * h**2 * K), inner @ K
    A, B = np.empty((N, 2 * J, 2 * J)), np.empty((N, 2 * J, J))
    A[:, :J, :J], A[:, :J, J:] = np.eye(J) - 0.5 * h**2 * back, 0.5 * h * (np.eye(J) + kept)
    A[:, J:, :J], A[:, J:, J:] = -h * back, kept
    B[:, :J], B[:, J:] = 0.5 * h**2 * inner, h * inner
    return A, B


def derivatives(
    tree: Tree, q: Array, dq: Array, ddq: Array, count: int | None = None
) -> tuple[Array, Array, Array]:
    """Derivatives of the torques by accelerations, velocities and positions, shape (Q, J, J) each.

    Args:
        tree: kinematic tree.
        q, dq, ddq: motion, shape (Q, J) each.
        count: number of leading joints by which to differentiate, instead of J; None: all.
    """
    J, out = q.shape[1], []
    for k in (2, 1, 0):
        columns = []
        for j in range(J if count is None else count):
            step = STEP_M if tree.slides[j] else STEP_RAD
            up, down = ([x.copy() for x in (q, dq, ddq)] for _ in range(2))
            up[k][:, j] += step
            down[k][:, j] -= step
            columns.append((torque_of(tree, *up) - torque_of(tree, *down)) / (2.0 * step))
        out.append(np.stack(columns, axis=2))
    out[0] = out[0] + np.diag(tree.armature)[:, :count]
    return out[0], out[1], out[2]


def bands_of(loops: Sequence[ClosedLoop]) -> Bands:
    """Bands of the innovations."""
    rates = [loop.signals.log.rate_hz for loop in loops]
    return Bands(rates, [len(loop.measured) for loop in loops], BANDS * min(rates))


def cells_of(
    loops: Sequence[tuple[ClosedLoop, Filtered]], residual: Sequence[Array], series: Sequence[Series]
) -> Cells:
    """Rows of the problem: whitened innovations of the positions.

    Args:
        loops: closed loop and filter of each run.
        residual: torque that the model lacks, shape (N, J) for each run.
        series: columns in torque by joint; an empty one stays without rows.
    """
    bands = bands_of([loop for loop, _ in loops])
    white = [
        f.innovations(r[:, :, None], loop.off)[:, :, 0] for (loop, f), r in zip(loops, residual, strict=True)
    ]
    cells, kept = Cells.of(bands, white), [k for k, own in enumerate(series) if own]
    found: list[list[tuple[NDArray[np.intp], Array]]] = [[] for _ in cells.channels]
    for first in range(0, len(kept), CHUNK):
        some, spectra = np.array(kept[first : first + CHUNK]), []
        for t, ((_, f), r) in enumerate(zip(loops, residual, strict=True)):
            torque = np.zeros((*r.shape, len(some)))
            for k, p in enumerate(some):
                for j, x in series[p].items():
                    torque[:, j, k] = x[t]
            # Each series is contiguous: the transforms take most of the time.
            faded = bands.faded(f.innovations(torque), t).T
            spectra.append(np.asarray(dct(faded, norm="ortho"))[:, :, : len(bands.of_trial(t))])
        rows = np.concatenate(spectra, axis=2)[:, :, cells.order]
        for c, own in enumerate(found):
            seen = rows[:, c].any(axis=1)  # two legs do not act on each other
            own.append((some[seen], rows[seen, c]))
    for channel, own in zip(cells.channels, found, strict=True):
        if own:
            indices, columns = (np.concatenate(x) for x in zip(*own, strict=True))
            cells.append(channel, indices.tolist(), columns.T)
        own.clear()
    cells.count = len(series)
    return cells
