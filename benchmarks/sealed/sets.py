"""Data sets of the sealed campaign: planned from a seed, drawn, simulated, read through the sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np

from estimator.recording.model import Recording
from hidden.generator import PAYLOADS, HiddenSet
from hidden.generator import generate as generate_hidden
from hidden.logger import Logger
from hidden.schedule import SHORT, Schedule
from mocobot.campaign.effects import gimbal_axes
from mocobot_sim.effects import Effect, apply_effects, effect_to_dict
from mocobot_sim.effects.geometry import GraspFlex, robot_mass_kg
from mocobot_sim.effects.readings import TorqueLag, TorqueSkew
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.soft import row_mass_kg, row_relaxation_s
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth
from sealed.backgrounds import BACKGROUNDS, Background, tolerated, units_of
from sealed.draw import BEYOND, CATALOGUE, NOWHERE, OTHER, SIZES, WORN, draw, family, largest, possible
from sealed.forms.base import Form
from sealed.ground import Ground

TIMESTEP_S = 1e-3
"""As the diagnosis: the integrator's error is below the sensors' noise."""
SCHEDULE = Schedule(randoms=2, vias=22, periodic_s=35.0, hold_s=3.0)
"""146 s or a little more: two random trials, a periodic one, a static one."""
Kind = Literal[
    "clean",
    "single",
    "forms",
    "unlisted",
    "pairs",
    "triples",
    "pushes",
    "sliding",
    "logs",
    "long",
    "left-out",
    "unlisted-pairs",
    "outside",
    "faults",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
SLIDING = (
    "joint_friction", "gimbal_friction", "sea_hysteresis", "grasp_play",
    "driven_lugre", "driven_dahl", "gimbal_lugre", "gimbal_dahl", "bouc_wen_spring", "soft_play",
)  # fmt: skip
"""Stiction and play, in the catalogue's form and in others."""
HOUR = Schedule(randoms=2, vias=1375, periodic_s=None, hold_s=None)
"""Two trials of half an hour: 1.31 s a via."""
SHARES = (0.4, 0.25, 0.2, 0.15)
"""Of the backgrounds where they are drawn."""

SPRINGS = {"base_compliance": "base{robot}_compliance_x", "grasp_flex": "grasp{robot}_flex_x"}
"""Rows of a scene that hold what gives way."""
LATE = {"torque_skew": "delay_s", "torque_lag": "time_constant_s"}
"""By how much one robot's torques come late: to rows it is the same who delays them."""


@dataclass(frozen=True)
class SealedSet:
    """One data set; equal ones give equal bits.

    Attributes:
        kind: what is hidden.
        seed: of everything random.
        background: the robots.
        names: causes, forms.
        factors: their sizes over the detection limit of the background.
        payload: name of a shipped payload.
        schedule: what is recorded.
        timestep_s: integration step [s].
    """

    kind: Kind
    seed: int
    background: Background
    names: tuple[str, ...] = ()
    factors: tuple[float, ...] = ()
    payload: str = "a"
    schedule: Schedule = SCHEDULE
    timestep_s: float = TIMESTEP_S

    @property
    def key(self) -> str:
        """Name of the set."""
        what = [f"{name}-x{factor:.3g}" for name, factor in zip(self.names, self.factors, strict=True)]
        return "_".join([str(self.seed), self.kind, self.background, *what])

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)

    def rng(self, purpose: str) -> np.random.Generator:
        """Independent stream for one purpose."""
        return np.random.default_rng([self.seed, *f"{self.kind}|{purpose}".encode()])


def plan(
    kind: Kind,
    seed: int,
    background: Background | None = None,
    factor: float | None = None,
    name: str | None = None,
    timestep_s: float = TIMESTEP_S,
) -> SealedSet:
    """Decide what a set is; everything that is not given is drawn from its seed.

    Args:
        kind: what is hidden.
        seed: of everything random.
        background: the robots; clean sets take turns.
        factor: size of every effect.
        name: the one cause or form of a set with one.
        timestep_s: integration step [s].
    """
    rng = np.random.default_rng([seed, *f"plan {kind}".encode()])
    drawn: Background = BACKGROUNDS[int(rng.choice(len(BACKGROUNDS), p=SHARES))]
    payload = str(rng.choice(list(PAYLOADS)))
    if kind == "clean":
        drawn = BACKGROUNDS[seed // 2 % len(BACKGROUNDS)]
        payload = PAYLOADS[(seed + seed // (2 * len(BACKGROUNDS))) % len(PAYLOADS)]
    background = background or drawn
    names = (name,) if name else _names(kind, seed, background, rng, factor or SIZES[0])
    factors = tuple(factor or _size(one, background, rng) for one in names)
    if kind == "logs":
        turn, number = divmod(seed, len(PAYLOADS))
        return SealedSet(
            kind, seed, "x1", (), (), PAYLOADS[number], SHORT[turn % len(SHORT)], 0.5 * TIMESTEP_S
        )
    schedule = HOUR if kind == "long" else SCHEDULE
    return SealedSet(kind, seed, background, names, factors, payload, schedule, timestep_s)


def _names(
    kind: Kind, seed: int, background: Background, rng: np.random.Generator, least: float
) -> tuple[str, ...]:
    if kind in ("clean", "logs"):
        return ()
    if kind == "pushes":
        return ("pushes",)
    several = {"pairs": 2, "triples": 3, "unlisted-pairs": 2}.get(kind, 1)
    pools: dict[Kind, tuple[str, ...]] = {
        "single": CATALOGUE, "left-out": CATALOGUE, "forms": OTHER, "unlisted": NOWHERE, "unlisted-pairs": NOWHERE,
        "sliding": SLIDING, "long": ("joint_friction", "push"), "outside": BEYOND, "faults": WORN,
    }  # fmt: skip
    found: list[str] = []
    while len(found) < several:
        # In sets of several, one in three has another form than the catalogue's.
        pool = pools.get(kind) or (OTHER if rng.uniform() < 1.0 / 3.0 else CATALOGUE)
        pool = possible(_in_turn(pool, seed + len(found)), background, least)
        found.append(next(name for name in pool if family(name) not in [family(other) for other in found]))
    return tuple(found)


def _in_turn(pool: Sequence[str], seed: int) -> list[str]:
    """The pool in an order in which successive seeds begin with every one once, then again in another order."""
    turn, at = divmod(seed, len(pool))
    order = np.random.default_rng([turn, *b"turn"]).permutation(len(pool))
    return [pool[k] for k in np.roll(order, -at)]


def _size(name: str, background: Background, rng: np.random.Generator) -> float:
    high = min(SIZES[1], largest(name, background))
    low = min(SIZES[0], high)  # one that was asked for by name may run with less only
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def generate(request: SealedSet) -> tuple[list[Recording], dict[str, Any]]:
    """Draw what is hidden, simulate the trials, read them through the sensors: recordings, and the truth.

    Raises:
        TrialError: the physics of a trial cannot be trusted.
    """
    if request.kind == "logs":
        return _logged(request)
    nominal = build_team(request.payload)
    units = units_of(request.background, nominal.robots, request.rng("units"))
    trajectories = request.schedule.trajectories(nominal, request.rng("trajectories"))
    ground = Ground.of(nominal, trajectories)
    hidden: list[Effect] = []
    for k, (name, factor) in enumerate(zip(request.names, request.factors, strict=True)):
        hidden += draw(name, factor, request.background, ground, request.rng(f"effect {k}"))
    taken = [place for effect in hidden for place in _places(effect)]
    background = [
        effect
        for effect in tolerated(request.background, nominal.robots, request.rng("background"))
        if _place(effect) not in taken
    ]
    recordings = []
    for number, trajectory in enumerate(trajectories, start=1):
        scene = build_team(request.payload, units, request.timestep_s)
        scene = apply_effects(scene, [*hidden, *background])
        log = run_trial(scene, trajectory, trial_number=number)
        noise = request.rng(f"sensors {number}")
        recordings.append(measure(log, sensor_preset("nominal"), noise, name=f"trial {number}"))
    truth = {
        "mass_kg": GroundTruth.of(nominal).mass_kg,
        "effects": [_told(effect, scene, background) for effect in hidden],
        "background": [effect_to_dict(effect) for effect in background],
        "units": [unit.to_dict() for unit in units],
        "gimbal_axes_1": gimbal_axes(nominal),
    }
    return recordings, truth


def _logged(request: SealedSet) -> tuple[list[Recording], dict[str, Any]]:
    """A healthy team as any lab's logger has it, brought onto one grid as ``mocobot convert`` does it."""
    logger = Logger.draw(np.random.default_rng([request.seed, *b"logger"]))
    healthy = HiddenSet(
        "clean", request.seed, payload=request.payload, schedule=request.schedule, timestep_s=request.timestep_s,
        logger=logger,
    )  # fmt: skip
    recordings, sealed = generate_hidden(healthy)
    return recordings, sealed.open({})


def _places(effect: Effect) -> list[tuple[Any, ...]]:
    """Cause and place of an effect, and of what is tolerated in its place."""
    where = _place(effect)
    if not isinstance(effect, Form):
        return [where]
    # MuJoCo has six joints between two bodies at most, so a grasp gives way in one form only.
    instead = (
        ("grasp_flex", "grasp_play") if effect.answer in ("grasp_flex", "grasp_play") else (effect.answer,)
    )
    return [where, *((cause, *where[1:]) for cause in instead)]


def _place(effect: Effect) -> tuple[Any, ...]:
    return effect.cause, *(getattr(effect, name) for name in effect.place_names())


def _told(effect: Effect, scene: TeamScene, background: Sequence[Effect]) -> dict[str, Any]:
    """An effect with its right ``answer`` {cause, robot, joint, known}, and the ``law`` of an unlisted one.

    What masses decide (``Effect.inherent``) is known as the scene has it. Behind a play a grasp gives way by what its
    ends do and what it would without: in one row, as springs in series. Torques are as late as the log and its
    sensors' own lag make them.
    """
    told = effect_to_dict(effect)
    if isinstance(effect, Form):
        cause, known, law = effect.answer, effect.known(), effect.law()
    else:
        cause, known, law = effect.cause, dict(told["parameters"]), None
        if cause in SPRINGS and known["relaxation_s"] < effect.inherent["relaxation_s"]:
            row, model = SPRINGS[cause].format(robot=told["robot"]), scene.compile()
            known["relaxation_s"] = row_relaxation_s(model, row)
            if cause == "base_compliance":
                armature = float(model.dof_armature[model.jnt_dofadr[model.equality(row).obj1id]][0])
                known["mass_kg"] = robot_mass_kg(scene, told["robot"]) + armature + row_mass_kg(model, row)
    if "contact_m_per_N" in known:
        own = (e for e in background if isinstance(e, GraspFlex) and e.robot == told["robot"])
        known["contact_m_per_N"] += sum(flex.compliance_m_per_N for flex in own)
    if cause in LATE and LATE[cause] in known:
        own = (e for e in background if isinstance(e, TorqueSkew | TorqueLag) and e.robot == told["robot"])
        known[LATE[cause]] += sum(getattr(late, LATE[late.cause]) for late in own)
    answer = {"cause": cause, "robot": told.get("robot"), "joint": told.get("joint"), "known": known}
    return told | {"form": isinstance(effect, Form), "answer": answer, "law": law}
