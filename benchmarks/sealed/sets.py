"""Data sets of the sealed campaign: planned from a seed, drawn, simulated, read through the sensors, kept on disk."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from discrepancy.team.causes import CAUSES
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from hidden import PAYLOADS, SHORT, HiddenSet, Logger, Schedule, ground_of
from hidden import generate as generate_hidden
from mocobot.campaign.effects import SPREAD_IN_UNCALIBRATED, UNDECIDABLE, draw_effect, gimbal_axes
from mocobot_sim.effects import EFFECTS, Effect, apply_effects, effect_to_dict
from mocobot_sim.effects.geometry import GraspFlex, robot_mass_kg
from mocobot_sim.effects.readings import TorqueLag, TorqueSkew
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.soft import row_mass_kg, row_relaxation_s
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth
from sealed import forces, readings
from sealed import joints as at_joints
from sealed import payload as at_payload
from sealed.form import Form, Ground
from sealed.limits import BACKGROUNDS, LIMITS, Background, limit_over_nominal, tolerated, units_of

LISTED: tuple[type[Form], ...] = (
    at_joints.DrivenLugre, at_joints.DrivenDahl, at_joints.GimbalLugre, at_joints.GimbalDahl,
    at_joints.BoucWenSpring, at_joints.SoftPlay, at_joints.SlowGrasp, at_joints.TurningGrasp,
    at_joints.SlowBaseCompliance, at_joints.LateCreep, at_payload.RampPush, at_payload.HalfSinePush,
    at_payload.DoublePendulum, at_payload.UnequalPendulum, at_joints.SecondOrderTorqueLag,
    at_joints.SingleTorqueLag, at_payload.PayloadCable, at_payload.RobotCable, at_payload.StiffeningStrap,
    at_payload.RubberCord, at_payload.TurningDrag, at_payload.PowerDrag, at_payload.MassDrift,
    at_payload.MassOfTrials,
)  # fmt: skip
UNLISTED: tuple[type[Form], ...] = (
    readings.CrossTalk, readings.WarmingScale, readings.WarmingZero, readings.Saturation,
    readings.QuadraticReading, readings.AngleInTorque, readings.TorqueHum, readings.EccentricPhi,
    readings.EccentricTheta, readings.CyclicPhi, readings.EncoderBacklash, readings.SoftEncoderMount,
    readings.SlippingZero, forces.Cogging, forces.CubicSpring, forces.CableSpring, forces.DoorCloser,
    forces.GrowingPush, forces.Shaker, forces.Gyroscope, forces.ShiftingLoad, forces.SinkingBase,
)  # fmt: skip
OUTSIDE: tuple[type[Form], ...] = (
    readings.ScratchedDisc, readings.SoftSaturation, readings.LooseBridge, readings.FineInterpolation,
    forces.SlackHose,
)  # fmt: skip
"""Unlisted ones whose formula the dictionary of laws does not have either."""
FAULTY: tuple[type[Form], ...] = (
    readings.DropoutsPhi, readings.DropoutsTheta, readings.TorqueRamp, readings.TorqueWalk, readings.DeadBand,
)  # fmt: skip
"""Unlisted ones of which sensors wear out."""
FAULTS = (
    *FAULTY, readings.CrossTalk, readings.EccentricPhi, readings.EccentricTheta, at_payload.MassDrift,
    at_payload.HalfSinePush,
)  # fmt: skip
"""These, and others that come with use: drawn by themselves."""
KNOWN: tuple[type[Form], ...] = (at_payload.QuadraticDrag, readings.TorqueBacklash)
"""Listed ones whose law the catalogue has by now: hidden by name only."""
FORMS: dict[str, type[Form]] = {form.cause: form for form in (*LISTED, *KNOWN, *UNLISTED, *OUTSIDE, *FAULTY)}


SIZES = (2.0, 20.0)
"""Over the limit; drawn evenly in logarithm."""
MOST: dict[str, float] = {
    "phi_zero": 60.0, "theta_zero": 80.0, "link_length": 40.0, "base_tilt": 40.0, "base_creep": 100.0,
    "base_compliance": 40.0, "grasp_flex": 25.0, "grasp_play": 20.0, "sea_bias": 50.0, "sea_scale": 40.0,
    "sea_hardening": 25.0, "sea_hysteresis": 30.0, "joint_friction": 40.0, "gimbal_friction": 25.0,
    "torque_skew": 15.0, "torque_lag": 5.0, "sensor_lag": 5.0, "clock_delay": 40.0,
    "second_order_torque_lag": 5.0, "single_torque_lag": 5.0, "turning_grasp": 15.0, "slow_grasp": 20.0,
    "soft_play": 20.0, "bouc_wen_spring": 12.0, "driven_lugre": 40.0, "driven_dahl": 40.0, "gimbal_lugre": 25.0,
    "gimbal_dahl": 25.0, "slow_base_compliance": 40.0, "late_creep": 100.0, "cubic_spring": 6.0,
    "dropouts_phi": 8.0, "dropouts_theta": 8.0,
}  # fmt: skip
"""Largest size over the limit within tolerances with which a trial runs: a torque loop with 9 ms of lag does not."""


def largest(name: str, background: Background) -> float:
    """Largest size over the limit of the background."""
    return MOST.get(name, np.inf) / over_nominal(name, background)


def over_nominal(name: str, background: Background) -> float:
    """Detection limit of a cause or form in a background over that within tolerances."""
    if name == "pushes":
        return 1.0
    if name in FORMS:
        return LIMITS[name][background] / LIMITS[name]["x1"]
    return limit_over_nominal(name, background)


def possible(names: Sequence[str], background: Background, least: float = SIZES[0]) -> list[str]:
    """Those that can be hidden in a background."""
    hidden = SPREAD_IN_UNCALIBRATED if background == "uncalibrated" else ()
    return [name for name in names if name not in hidden and largest(name, background) >= least]


def family(name: str) -> str:
    """Family of a cause or form; an unlisted one is its own."""
    answer = FORMS[name].answer if name in FORMS else name
    return CAUSES[answer].family if answer in CAUSES else f"unlisted {name}"


def draw(
    name: str, factor: float, background: Background, ground: Ground, rng: np.random.Generator
) -> list[Effect]:
    """One effect of ``factor`` times the limit of its background; ``pushes`` are one in every trial that moves."""
    if name == "pushes":
        kind = at_payload.RampPush if rng.uniform() < 0.5 else at_payload.HalfSinePush
        return list(at_payload.in_every_trial(kind, factor * LIMITS[kind.cause][background], ground, rng))
    if name in EFFECTS:
        factor *= limit_over_nominal(name, background)
        return [draw_effect(name, factor, ground_of(ground.robots, ground.p_1c, ground.moving), rng)]
    form = FORMS[name]
    return [form.drawn(factor * LIMITS[name][background], ground, _place(form, ground, rng), rng)]


def _place(form: type[Form], ground: Ground, rng: np.random.Generator) -> dict[str, int]:
    names = form.place_names()
    joints = [joint for joint in (1, 2, 3) if (form.answer, joint) not in UNDECIDABLE]
    place = {"robot": int(rng.integers(1, ground.robots + 1))} if "robot" in names else {}
    return place | ({"joint": int(rng.choice(joints))} if "joint" in names else {})


CATALOGUE = tuple(name for name in CAUSES if name in EFFECTS)
OTHER = tuple(form.cause for form in LISTED)
NOWHERE = tuple(form.cause for form in UNLISTED)
BEYOND = tuple(form.cause for form in OUTSIDE)
WORN = tuple(form.cause for form in FAULTS)


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
"""Shares of the backgrounds where they are drawn."""

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
        if _place_of(effect) not in taken
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
    where = _place_of(effect)
    if not isinstance(effect, Form):
        return [where]
    # MuJoCo has six joints between two bodies at most, so a grasp gives way in one form only.
    instead = (
        ("grasp_flex", "grasp_play") if effect.answer in ("grasp_flex", "grasp_play") else (effect.answer,)
    )
    return [where, *((cause, *where[1:]) for cause in instead)]


def _place_of(effect: Effect) -> tuple[Any, ...]:
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


def folder_of(request: SealedSet, out: Path) -> Path:
    """Where a set is kept."""
    return out / "sets" / request.key


def is_simulated(request: SealedSet, out: Path) -> bool:
    """Whether it is there, whole."""
    return (folder_of(request, out) / "truth.json").is_file()


def simulate(request: SealedSet, out: Path) -> dict[str, Any]:
    """Simulate a set, and keep its recordings and its truth.

    Raises:
        TrialError: the physics of a trial cannot be trusted.
    """
    here = folder_of(request, out)
    here.mkdir(parents=True, exist_ok=True)
    recordings, truth = generate(request)
    for number, recording in enumerate(recordings, start=1):
        write_recording(recording, here / f"trial{number}.parquet")
    content = {"request": request.to_dict(), "truth": truth}
    temporary = here / "truth.tmp"
    temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    os.replace(temporary, here / "truth.json")  # last: a folder with a truth is complete
    return truth


def kept(out: Path) -> list[SealedSet]:
    """Every set that is there, whole, by seed."""
    requests = []
    for path in sorted((out / "sets").glob("*/truth.json")):
        values = json.loads(path.read_text(encoding="utf-8"))["request"]
        values["schedule"] = Schedule(**values["schedule"])
        values |= {name: tuple(values[name]) for name in ("names", "factors")}
        requests.append(SealedSet(**values))
    return sorted(requests, key=lambda request: request.seed)


def recordings_of(request: SealedSet, out: Path) -> list[Path]:
    """Files of its trials, in order."""
    return sorted(folder_of(request, out).glob("trial*.parquet"))


def truth_of(request: SealedSet, out: Path) -> dict[str, Any]:
    """What was hidden.

    Raises:
        ValueError: the folder belongs to another request.
    """
    path = folder_of(request, out) / "truth.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    if content["request"] != json.loads(json.dumps(request.to_dict())):
        raise ValueError(f"{path} belongs to another request; delete its folder or choose another one")
    return content["truth"]


def forget(request: SealedSet, out: Path) -> None:
    """Delete its recordings; the truth stays with the results."""
    shutil.rmtree(folder_of(request, out))


def append(path: Path, result: dict[str, Any]) -> None:
    """Add one line; a line is written whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, (json.dumps(result) + "\n").encode())
    finally:
        os.close(descriptor)


def read(path: Path) -> list[dict[str, Any]]:
    """All results; of a set that was repeated, the last."""
    if not path.is_file():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({(line.get("part"), line["key"]): line for line in lines}.values())
