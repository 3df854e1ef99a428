"""Simulate one set of a campaign: its robots, what is hidden in them, and their recordings."""

from collections.abc import Sequence
from typing import Any

from estimator.errors import InputError
from estimator.recording.model import Recording
from mocobot.api.given import recordings_of
from mocobot.api.simulation import simulate_trials
from mocobot.campaign.background import SPREAD_IN_UNCALIBRATED, cheaper, draw_background
from mocobot.campaign.draw import draw_at
from mocobot.campaign.ground import Ground, gimbal_axes
from mocobot.campaign.limits import MeasuredLimits
from mocobot.campaign.plan import CampaignPlan, CampaignSet
from mocobot_sim.effects import Effect, effect_to_dict
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
