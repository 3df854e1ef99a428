"""Run a campaign: every set simulated, diagnosed blind, and kept; what is there already is not done again.

The file of a set: ``set`` (``CampaignSet.to_dict``), ``error`` (why there is no verdict, or null), ``unexpected``
(whether that was a fault of the program), ``truth`` (``simulate_set``), ``verdict`` (of ``discrepancy.result.json``
what a score needs) and, of a clean set, ``limits`` {places, pushes} (``campaign.limits``).
"""

import traceback
from collections.abc import Callable, Sequence
from typing import Any

from joblib import Parallel, delayed

from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.told import TeamDiagnosed
from estimator.errors import InputError
from estimator.files import ends_with_this
from estimator.recording.model import Recording
from mocobot.api.given import Robots, recordings_of
from mocobot.api.simulation import simulate_trials
from mocobot.campaign.background import SPREAD_IN_UNCALIBRATED, cheaper, draw_background
from mocobot.campaign.draw import draw_at
from mocobot.campaign.ground import Ground, gimbal_axes
from mocobot.campaign.limits import MeasuredLimits, push_limits
from mocobot.campaign.plan import CampaignPlan, CampaignSet
from mocobot.campaign.store import CampaignStore
from mocobot_sim.effects import Effect, effect_to_dict
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, make_trajectory
from mocobot_sim.trial.trajectories import Trajectory


def simulate_set(
    plan: CampaignPlan, one: CampaignSet, limits: MeasuredLimits | None
) -> tuple[list[Recording], dict[str, Any]]:
    """Recordings of a set as any others are, and the truth: ``effects``, ``units``, ``gimbal_axes_1`` and
    ``control``, whether that was stable in each trial.

    Args:
        plan: the campaign.
        one: the set.
        limits: what sizes are multiples of; None for a clean set.

    Raises:
        InputError: nothing shows such an effect anywhere in this team, or none is so large.
        TrialError: the physics of a trial cannot be trusted.
    """
    nominal = build_team(plan.payload)
    units = _units(plan, one, nominal.robots)
    seed = int(plan.rng(one.key, "trials").integers(2**31))
    hidden: list[Effect] = []
    if limits is not None:
        trajectories = _trajectories(plan, seed, build_team(plan.payload, units))
        hidden.append(_drawn(plan, one, Ground.of(nominal, trajectories, limits), limits))
    places = [_place(effect) for effect in hidden]
    # One cause acts once at a place: what is hidden takes the place of what is tolerated there.
    tolerated = [e for e in _tolerated(plan, one, nominal.robots) if _place(e) not in places]
    done = simulate_trials(
        plan.payload, plan.trials,
        vias=plan.vias, duration_s=plan.duration_s, preset=plan.preset, seed=seed,
        effects=[*hidden, *tolerated], units=units,
    )  # fmt: skip
    truth = {
        "effects": [_told(effect) for effect in hidden],
        "units": [unit.to_dict() for unit in units],
        "gimbal_axes_1": gimbal_axes(nominal),
        "control": [one.log.stability and one.log.stability.to_dict() for one in done],
    }
    return list(recordings_of(done)), truth


def _units(plan: CampaignPlan, one: CampaignSet, robots: int) -> Sequence[AsBuilt]:
    if one.background == "uncalibrated":
        return sensor_preset("uncalibrated").spread.draw(robots, plan.rng(one.clean.key, "units"))
    return plan.units if one.background == "units" else ()


def _tolerated(plan: CampaignPlan, one: CampaignSet, robots: int) -> list[Effect]:
    """What is a little off everywhere, the same in all sets of a team; units have theirs already."""
    drawn = cheaper(
        draw_background(robots, plan.rng(one.clean.key, "tolerances"), tolerances=plan.tolerances)
    )
    has = () if one.background == "calibrated" else SPREAD_IN_UNCALIBRATED
    return [effect for effect in drawn if effect.cause not in has]


def _trajectories(plan: CampaignPlan, seed: int, team: TeamScene) -> list[Trajectory]:
    """Commands of the trials, as ``simulate_trials`` makes them, for their lengths."""
    given = {"vias": plan.vias, "duration_s": plan.duration_s}
    told: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return [
        make_trajectory(TrialRequest(plan.payload, kind, seed, plan.trials[:k].count(kind), **told), team)
        for k, kind in enumerate(plan.trials)
    ]


def _drawn(plan: CampaignPlan, one: CampaignSet, ground: Ground, limits: MeasuredLimits) -> Effect:
    assert one.cause is not None
    assert one.factor is not None
    places = limits.where(one.cause, [number for number, _, _ in ground.moving])
    if not places:
        raise InputError(f"{one.cause}: nothing in these recordings shows it, however large")
    rng = plan.rng(one.key, "effect")
    robot, joint = places[int(rng.integers(len(places)))]
    return draw_at(one.cause, one.factor, robot, joint, ground, rng)


def _place(effect: Effect) -> tuple[Any, ...]:
    return effect.cause, *(getattr(effect, name) for name in effect.place_names())


def _told(effect: Effect) -> dict[str, Any]:
    """An effect with the right answer, as ``campaign.score`` takes it."""
    told = effect_to_dict(effect)
    answer = {name: told.get(name) for name in ("cause", "robot", "joint")} | {"known": told["parameters"]}
    return told | {"answer": answer}


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


def _diagnosed(plan: CampaignPlan, recordings: Sequence[Recording]) -> TeamDiagnosed:
    robots = Robots(plan.calibration)
    return diagnose_team(
        [robots.of(recording) for recording in recordings], plan.tolerances, plan.exclude,
        closed_loop=plan.closed_loop,
    )  # fmt: skip


def _limits(plan: CampaignPlan, found: TeamDiagnosed) -> Json:
    return {
        "places": found.to_dict()["detection_limits"],
        "pushes": [] if "push" in plan.exclude else push_limits(found.outcome, plan.tolerances["push"]),
    }
