"""What a cause is worth: recorded commands resimulated, with and without it, on trials it was not fitted to."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig
from discrepancy.team.gain import Gain, Response
from estimator.arrays import Array
from estimator.processes import ends_with_this

Active = list[tuple[Candidate, Array]]
"""Candidates and the values of their parameters."""


def responses(
    rig: Rig, problem: Problem, hypotheses: Sequence[Sequence[int]], jobs: int = 1,
    progress: Callable[[int], object] | None = None, *, whole: bool = False,
) -> list[tuple[Response | None, ...]]:  # fmt: skip
    """Simulate every trial under every hypothesis, with unknowns and causes fitted to the other trials.

    Args:
        rig: the rig.
        problem: the linear problem.
        hypotheses: sets of candidates (indices into the problem) that are in the model.
        jobs: parallel processes.
        progress: called with 1 for every simulated trial.
        whole: as of ``fit_to_simulate``.
    """
    trials = problem.trials
    tasks = []
    for free in hypotheses:
        for t in rig.resimulated:
            others = [k for k in trials if k != t] or [t]
            # What is there in some trials only says nothing about others; its own trials have to tell it.
            if any(problem.candidates[i].of_trials for i in free):
                others = list(trials)
            fit, healthy = fit_to_simulate(rig, problem, free, others, whole=whole)
            tasks.append((t, -fit.shared, -fit.local(t)[: rig.local_unknowns], fit.active, healthy))
    run = Parallel(n_jobs=jobs, return_as="generator", **ends_with_this())
    done = []
    for errors, task in zip(run(delayed(rig.simulation(*task))() for task in tasks), tasks, strict=True):
        done.append(None if errors is None else Response.of(errors, rig.response_scale(task[0])))
        if progress:
            progress(1)
    count = len(rig.resimulated)
    return [tuple(done[k * count : (k + 1) * count]) for k in range(len(hypotheses))]


def with_all_as_found(
    gain: Gain, rig: Rig, problem: Problem, free: Sequence[int], jobs: int = 1,
    progress: Callable[[int], object] | None = None,
) -> Gain:  # fmt: skip
    """The gain with responses of healthy parts as they are found, where more than noise is left without.

    Args:
        gain: with responses.
        rig, problem, jobs, progress: as of ``responses``.
        free: the causes.
    """
    left = [b.chi2_per_n for _, b in gain.pairs]
    if not rig.whole or not left or np.mean(left) <= rules.VISIBLE_CHI2_PER_N:
        return gain
    return replace(gain, as_found=responses(rig, problem, [free], jobs, progress, whole=True)[0])


def fit_to_simulate(
    rig: Rig, problem: Problem, free: Sequence[int], trials: Sequence[int] | None = None, *,
    whole: bool = False,
) -> tuple[Fit, Active]:  # fmt: skip
    """Unknowns and causes as a simulation takes them, and how far off healthy parts are in it.

    Those are as designed; but where a rig had to be linearised elsewhere, as they are found there beside the causes.
    Where a simulation finds what is normal by itself, causes are what they are beside that.

    Args:
        rig, problem, free: as of ``responses``.
        trials: that tell; None for all.
        whole: whether a simulation has every healthy part as it is found, within its tolerance, too.
    """
    if rig.normal:
        return Fit.of(problem, free, trials), []
    carried = [
        i
        for i, candidate in enumerate(problem.candidates)
        if i not in free and (rig.carried(candidate) or (whole and problem.has_tolerance(i)))
    ]
    if not carried:
        return Fit.of(problem, free, trials, background=False), []
    found = Fit.of(problem, free, trials)
    parts = {i: found.part(i)[0] for i in carried}
    values = np.append(np.zeros(problem.width - 1), 1.0)
    for i, part in parts.items():
        values[problem.spans[i]] = -part
    left = [problem.raw_times(t, values) for t in problem.trials]
    fit = Fit.of(problem.with_residual(left), free, trials, background=False)
    return fit, [(problem.candidates[i], part * problem.candidates[i].units) for i, part in parts.items()]
