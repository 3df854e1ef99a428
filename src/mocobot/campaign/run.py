"""Run a campaign: every set simulated, diagnosed blind, and kept; what is there already is not done again.

The file of a set: ``set`` (``CampaignSet.to_dict``), ``error`` (why there is no verdict, or null), ``unexpected``
(whether that was a fault of the program), ``truth`` (``simulate_set``), ``verdict`` (of ``discrepancy.result.json``
what a score needs) and, of a clean set, ``limits`` {places, pushes} (``campaign.limits``).
"""

import traceback
from collections.abc import Callable, Sequence
from typing import Any

from joblib import Parallel, delayed

from discrepancy.result.diagnosed import Diagnosed
from discrepancy.result.sensitivity import detection_limits
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.rig import TeamRig
from estimator.errors import InputError
from estimator.processes import ends_with_this
from estimator.recording.model import Recording
from mocobot.api.given import Robots
from mocobot.campaign.limits import MeasuredLimits, push_limits
from mocobot.campaign.plan import CampaignPlan, CampaignSet
from mocobot.campaign.simulate import simulate_set
from mocobot.campaign.store import CampaignStore
from mocobot_sim.errors import TrialError

Json = dict[str, Any]
KEPT = ("verdict", "causes", "suspected", "scatter", "residual", "notes")
"""Of a diagnosis; the rest is large, and for one recording's reader."""


def run_campaign(
    plan: CampaignPlan,
    store: CampaignStore,
    jobs: int = 1,
    done: Callable[[int], object] = lambda _: None,
    *,
    remote: bool = False,
    work: Callable[[tuple[CampaignPlan, CampaignSet, Json | None]], Json] | None = None,
) -> list[Json]:
    """Run what is not there yet, clean sets first: they say how large effects must be.

    Args:
        plan: the campaign.
        store: where results are and go.
        jobs: processes; results do not depend on them.
        done: called with the number of sets that have ended.
        remote: whether joblib's backend has its processes on other machines.
        work: what makes a result of (plan, set, limits); ``run_set`` if None.

    Returns:
        The results of all sets, clean ones first, in the order of the plan.

    Raises:
        InputError: a result cannot be read or written.
    """
    clean, hidden = plan.clean_sets(), plan.hidden_sets()
    _run([(plan, one, None) for one in clean], store, jobs, done, remote, work or run_set)
    limits = {one: store.get(one).get("limits") for one in clean}
    tasks = [(plan, one, limits[one.clean]) for one in hidden]
    _run(tasks, store, jobs, done, remote, work or run_set)
    return [store.get(one) for one in [*clean, *hidden]]


def _run(
    tasks: Sequence[tuple[CampaignPlan, CampaignSet, Json | None]],
    store: CampaignStore,
    jobs: int,
    done: Callable[[int], object],
    remote: bool,
    work: Callable[..., Json],
) -> None:
    todo = [task for task in tasks if not store.has(task[1])]
    done(len(tasks) - len(todo))
    pool = Parallel(
        n_jobs=jobs,
        return_as="generator_unordered",
        pre_dispatch="all" if remote else "2 * n_jobs",
        **ends_with_this(),
    )
    results: Any = pool(delayed(work)(task) for task in todo)
    for result in results:
        store.put(result)
        done(1)


def run_set(task: tuple[CampaignPlan, CampaignSet, Json | None]) -> Json:
    """Simulate and diagnose one set; the truth is put beside the verdict when that is there.

    What goes wrong in it is its result: one set must not end a campaign.
    """
    plan, one, limits = task
    result: Json = {"set": one.to_dict(), "error": None, "unexpected": False}
    try:
        if one.cause is not None and limits is None:
            raise InputError(
                f"team {one.team} has no detection limits, since its clean set was not diagnosed"
            )
        known = None if limits is None else MeasuredLimits(limits["places"], limits["pushes"])
        recordings, truth = simulate_set(plan, one, known)
        found = _diagnosed(plan, recordings)
        result |= {"truth": truth, "verdict": {key: found.to_dict()[key] for key in KEPT}}
        if one.cause is None:
            result["limits"] = _limits(plan, found)
    except (InputError, TrialError) as error:
        result["error"] = str(error)
    except Exception:
        result |= {"error": traceback.format_exc(), "unexpected": True}
    return result


def _diagnosed(plan: CampaignPlan, recordings: Sequence[Recording]) -> Diagnosed:
    robots = Robots(plan.calibration)
    return diagnose_team(
        [robots.of(recording) for recording in recordings], plan.tolerances, plan.exclude,
        closed_loop=plan.closed_loop,
    )  # fmt: skip


def _limits(plan: CampaignPlan, found: Diagnosed) -> Json:
    assert isinstance(found.rig, TeamRig)
    return {
        "places": detection_limits(found.diagnosis.explanation),
        "pushes": [] if "push" in plan.exclude else push_limits(found.rig, plan.tolerances["push"]),
    }
