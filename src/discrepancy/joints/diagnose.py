"""Find the likeliest causes in the logs of a robot's joints, and express the rows of the result in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.parts import Parts
from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.search import Chosen, Search, State, Until, floor_of
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.joints.model import SerialModel
from discrepancy.joints.mount import mount_of
from discrepancy.joints.problem import Given, JointProblem, joint_problem
from discrepancy.joints.signals import Signals
from discrepancy.joints.trials import Trials, trials_of
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog

MOVED = (" zero", " mass share", " com ", " inertia share", " length ", " tilt ", " delay_s", " scale", " payload ",
         " gravity turn", " armature_kgm2", " coulomb_Nm", " viscous_Nms_per_rad")  # fmt: skip
"""Labels of columns whose values define the linearisation point."""
CURVED = ("gravity_direction", "joint_zero", "link_length", "torque_delay")
"""Causes with nonlinear effects: other causes show only after linearisation around their values."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a search.

    Attributes:
        problem: the problem, linearised around the result.
        search: the search on this problem.
        state: the likeliest set.
        nothing: the search on the problem linearised around the model as it is; None: ``search`` is that search.
        finished: whether the search completed.
    """

    problem: JointProblem
    search: Search
    state: State
    nothing: Search | None = None
    finished: bool = True


def diagnose(
    model: SerialModel, logs: Sequence[JointLog] | Trials, settings: Settings = SETTINGS,
    say: Callable[[str], object] = lambda _: None, given: Given | None = None, until: Until | None = None,
) -> Outcome:  # fmt: skip
    """Find the likeliest causes of the residual torques of a model.

    The problem is linearised again around the result until the set no longer changes. A set replaces another only
    if its evidence is higher, with each linearised around itself.

    Args:
        model: the robot as described.
        logs: joint logs with torques, or trials.
        settings: constants of the search.
        say: receives a line of text about each step.
        given: options of the problem.
        until: stop criterion.
    """
    until = until or Until()
    trials = logs if isinstance(logs, Trials) else trials_of(model, logs)
    smooth, given = trials.runs, replace(given or Given(), noise=trials.noise or None, kept=trials.kept)
    if given.changed is None and not given.motors and "gravity_direction" not in given.excluded:
        given = replace(given, mount=mount_of(smooth, given.joints or range(len(model.joints))))
    problem = joint_problem(model, smooth, None, given)
    search = Search(problem, floor_of(problem, problem.slabs(), settings), settings, say, until)

    def bent(state: State, new: frozenset[str]) -> bool:
        return given.changed is None and not new.isdisjoint(CURVED)

    again, first = partial(_around, smooth=smooth, given=given), Outcome(problem, search, search.fixed(()))
    if given.mount is not None:  # all loads are others there, so look for further causes from there on
        turned = [Chosen(g, 1.0) for g in problem.groups if g.cause == "gravity_direction"]
        first = again(replace(first, state=search.fixed(turned)), floor=None)
    first = replace(first, state=until.run(first.search, first.state, bent), finished=not until.broken)
    if given.changed is not None or until():
        return first  # with a reference, the common model error has no linearisation point
    around = again(first, floor=None)
    for _ in range(settings.rounds):
        found = Outcome(around.problem, around.search, until.run(around.search, around.state))
        if until():
            around = found
            break
        around = found if found.state.keys == around.state.keys else around
        other = again(found, floor=around.search.floor)
        if other.state.evidence < around.state.evidence + settings.need_nats:
            break  # no improvement after linearisation around the set
        around = other
    return replace(around, nothing=search, finished=not until.broken)


def _around(found: Outcome, *, smooth: Sequence[Signals], given: Given, floor: Array | None) -> Outcome:
    """Linearise around a result's values and compute its set again; ``floor`` None: compute a new noise floor."""
    x = found.state.posterior.mean
    values = {
        label: float(x[i])
        for i, label in enumerate(found.problem.labels)
        if x[i] and any(word in f" {label}" for word in MOVED) and "{" not in label
    }
    problem, before = joint_problem(found.problem.model, smooth, values, given), found.search
    if floor is None:
        floor = floor_of(problem, problem.slabs(), before.settings)
    search = replace(before, problem=problem, floor=floor, best=None)
    chosen = []
    for c in found.state.chosen:
        again = [g for g in problem.groups if g.key == c.group.key and g.shape == c.group.shape]
        if c.group.event or (c.group.cause == "soft_stand" and not again):
            again = [problem.place(c.group)]
        chosen += [Chosen(g, c.scale) for g in again]
    return Outcome(problem, search, search.fixed(chosen))


def labels_of(outcome: Outcome) -> dict[str, tuple[float, float]]:
    """Values and standard errors of the chosen causes by column label, fitted with priors too wide to shrink them."""
    state = outcome.state
    prior = state.posterior.prior.copy()
    for c in state.chosen:
        k = list(c.group.columns)
        prior[k] = np.maximum(prior[k], (SETTINGS.plain * np.array(c.group.slab)) ** 2)
    p = Posterior(outcome.problem.cells, prior, state.posterior.variance)
    se = np.sqrt(p.variances)
    return {
        outcome.problem.labels[k] if k < len(outcome.problem.labels) else f"{c.group.place} {n}": (
            float(p.mean[k]),
            float(se[k]),
        )
        for c in state.chosen
        for n, k in enumerate(c.group.columns)
    }


@dataclass(frozen=True, eq=False)
class Series:
    """Rows of one part as time series.

    Attributes:
        residual, columns: shapes (n, C) and (n, C, K).
        measured: measured torque, faded like the residual, shape (n, C).
        time: log time [s], shape (n,).
        rate_hz: sampling rate of the rows.
        unit: factor from rows to physical units.
    """

    residual: Array
    columns: Array
    measured: Array
    time: Array
    rate_hz: float
    unit: float

    def left(self, x: Array) -> Array:
        """Residual after subtracting the columns at values x, in physical units, shape (n, C)."""
        return (self.residual - self.columns @ x) * self.unit


def parts_of(outcome: Outcome, trials: Trials) -> tuple[Parts, tuple[Series, ...]]:
    """Split the rows of a search result into the parts of the trials."""
    state, problem = outcome.state, outcome.problem
    active = np.flatnonzero(state.posterior.prior)
    out, cells = in_parts(problem, active, trials)
    each = [(*own.weighted(state.posterior.variance), own.rows) for own in cells]
    events = [k for c in state.chosen if c.group.event for k in (*c.group.columns, *c.forms)]
    resting = [k for columns, _ in problem.resting for k in columns]
    return Parts.of(state, each, resting, resting, events), out


def in_parts(
    problem: JointProblem, active: NDArray[np.intp], trials: Trials
) -> tuple[tuple[Series, ...], list[Cells]]:
    """Rows of each part as time series, and by channel and band.

    Args:
        problem: the problem of all trials.
        active: columns to keep, in increasing order.
        trials: the trials.
    """
    whole = problem.cells
    by_run, each, out = _in_time(whole, active), [], []
    place = {int(k): i for i, k in enumerate(active)}
    seen = [
        np.array([place[int(k)] for k in c.columns if int(k) in place], dtype=np.intp) for c in whole.channels
    ]
    for k, at in trials.parts:
        residual, columns = by_run[k]
        own = trials.runs[k]
        share = len(residual) / len(own.time)  # ratio of row samples to log samples
        here = slice(round(at.start * share), max(round(at.stop * share), round(at.start * share) + 2))
        residual, columns = residual[here], columns[here]
        rate = own.rate_hz * share
        time = own.time[0] + (np.arange(len(residual)) + here.start + 0.5) / rate
        measured = _measured(whole.bands, own.torque[:, trials.joints], k)[here]
        out.append(Series(residual, columns, measured, time, rate, float(np.sqrt(share))))
        each.append(_cells(residual, columns, seen, Bands([rate], [len(residual)], whole.bands.edges_hz)))
    return tuple(out), each


def _in_time(cells: Cells, active: NDArray[np.intp]) -> list[tuple[Array, Array]]:
    """Transform the rows of each run into time series (n, C) and (n, C, K); white noise keeps its variance."""
    place = {int(k): i for i, k in enumerate(active)}
    counts = [len(cells.bands.of_trial(t)) for t in range(len(cells.bands.lengths))]
    out = [
        (np.zeros((n, len(cells.channels))), np.zeros((n, len(cells.channels), len(active)))) for n in counts
    ]
    for c, channel in enumerate(cells.channels):
        keep = [i for i, k in enumerate(channel.columns) if int(k) in place]
        at = [place[int(channel.columns[i])] for i in keep]
        y, X = np.empty_like(channel.y), np.empty((len(channel.y), len(keep)))
        y[cells.order], X[cells.order] = channel.y, channel.X[:, keep]
        first = 0
        for (residual, columns), n in zip(out, counts, strict=True):
            residual[:, c] = np.asarray(idct(y[first : first + n], norm="ortho"))
            columns[:, c, at] = np.asarray(idct(X[first : first + n], axis=0, norm="ortho"))
            first += n
    return out


def _measured(bands: Bands, torque: Array, run: int) -> Array:
    """Turn the torques of a run, shape (W, C), into rows (n, C)."""
    kept = bands.kept[run] if bands.kept else 1.0
    rows = np.asarray(dct(bands.faded(torque * kept, run), axis=0, norm="ortho"))[: len(bands.of_trial(run))]
    return np.asarray(idct(rows, axis=0, norm="ortho"))


def _cells(residual: Array, columns: Array, seen: Sequence[NDArray[np.intp]], bands: Bands) -> Cells:
    """Gram matrices of one part from its time series."""
    cells = Cells.of(bands, [residual])
    for c, channel in enumerate(cells.channels):
        X = np.asarray(dct(columns[:, c, seen[c]], axis=0, norm="ortho"))[: len(bands.of_trial(0))][
            cells.order
        ]
        channel.columns, channel.X = seen[c], X
        channel.grams = np.array([X[a:b].T @ X[a:b] for a, b in pairwise(channel.starts)])
        channel.products = np.array([X[a:b].T @ channel.y[a:b] for a, b in pairwise(channel.starts)])
    cells.count = columns.shape[2]
    return cells
