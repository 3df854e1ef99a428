"""The blind generator: recordings of a team in which something may be hidden, and the sealed truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from estimator.recording.model import Recording
from hidden.draw import Tabled
from hidden.logger import Logger
from hidden.schedule import Schedule
from hidden.sealed import Sealed
from mocobot.campaign.effects import Ground, draw_background, draw_effect, gimbal_axes
from mocobot_sim.effects import Effect, apply_effects, effect_to_dict
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth

PAYLOADS = "abcd"
TIMESTEP_S = 5e-4
"""Half of what the diagnosis simulates with."""

Kind = Literal["clean", "tolerance", "single", "pair"]


@dataclass(frozen=True)
class HiddenSet:
    """One data set; equal requests give equal bits.

    Attributes:
        kind: ``clean``, ``tolerance`` (every parameter of every cause within its tolerance), ``single`` or ``pair``.
        seed: of everything random.
        causes: what is hidden.
        factor: size over the detection limit.
        payload: name of a shipped payload; None to draw one.
        background: tolerances besides what is hidden.
        preset: sensors.
        schedule: what is recorded.
        timestep_s: integration step [s].
        logger: what stands between the sensors and the recordings, as ``mocobot convert`` makes them of its log; None
            for samples as they are simulated.
    """

    kind: Kind
    seed: int
    causes: tuple[str, ...] = ()
    factor: float = 4.0
    payload: str | None = None
    background: bool = False
    preset: str = "nominal"
    schedule: Schedule = field(default_factory=Schedule)
    timestep_s: float = TIMESTEP_S
    logger: Logger | None = None

    def rng(self, purpose: str) -> np.random.Generator:
        """Independent stream for one purpose."""
        words = f"{purpose}|{self.kind}|{'+'.join(self.causes)}|{self.factor:g}".encode()
        return np.random.default_rng(np.random.SeedSequence([self.seed, *words]))


def generate(request: HiddenSet) -> tuple[list[Recording], Sealed]:
    """Draw what is hidden, simulate the trials, read them through the sensors.

    Raises:
        TrialError: the physics of a trial cannot be trusted.
    """
    payload = request.payload or str(request.rng("payload").choice(list(PAYLOADS)))
    team = build_team(payload)
    trajectories = request.schedule.trajectories(team, request.rng("trajectories"))
    ground = Ground.of(team, trajectories, Tabled())
    hidden, background = _effects(request, ground)
    recordings = _recorded(request, payload, trajectories, [*hidden, *background])
    truth = {
        "payload": payload,
        "mass_kg": GroundTruth.of(team).mass_kg,
        "effects": [_with_answer(effect_to_dict(effect)) for effect in hidden],
        "background": [effect_to_dict(effect) for effect in background],
        "gimbal_axes_1": gimbal_axes(team),
    }
    return recordings, Sealed(truth)


def _recorded(
    request: HiddenSet, payload: str, trajectories: Sequence[Trajectory], effects: Sequence[Effect]
) -> list[Recording]:
    recordings = []
    for number, trajectory in enumerate(trajectories, start=1):
        scene = apply_effects(build_team(payload, timestep_s=request.timestep_s), effects)
        log, noise = run_trial(scene, trajectory, trial_number=number), request.rng(f"sensors {number}")
        name = f"trial {number}"
        if request.logger:
            recordings.append(request.logger.recorded(log, noise, name))
        else:
            recordings.append(measure(log, sensor_preset(request.preset), noise, name=name))
    return recordings


def _effects(request: HiddenSet, ground: Ground) -> tuple[list[Effect], list[Effect]]:
    hidden = [
        draw_effect(cause, request.factor, ground, request.rng(f"effect {k}"))
        for k, cause in enumerate(request.causes)
    ]
    if not (request.background or request.kind == "tolerance"):
        return hidden, []
    background = draw_background(ground.robots, request.rng("background"))
    # One cause acts once at a place: what is hidden takes the place of what is tolerated there.
    taken = [_place(effect) for effect in hidden]
    return hidden, [effect for effect in background if _place(effect) not in taken]


def _with_answer(told: dict[str, Any]) -> dict[str, Any]:
    """An effect with its right answer, as ``mocobot.campaign.summary.match`` takes it."""
    place = {name: told.get(name) for name in ("robot", "joint")}
    return told | {"answer": {"cause": told["cause"], **place, "known": told["parameters"]}}


def _place(effect: Effect) -> Sequence[Any]:
    return effect.cause, *(getattr(effect, name) for name in effect.place_names())
