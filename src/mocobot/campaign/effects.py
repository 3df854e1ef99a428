"""Draw the hidden effects of a campaign (kind, place, size) and the tolerated deviations of healthy robots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.candidate import Candidate, Transient
from discrepancy.evidence.posterior import Posterior
from discrepancy.team.causes import CAUSES, default_tolerances
from discrepancy.team.causes.payload import MASS_OVER_S
from discrepancy.team.diagnose import TeamOutcome
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array
from mocobot_sim.effects import EFFECTS, Effect, make_effect
from mocobot_sim.effects import friction_and_springs as listed
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.trajectories import SETTLE_S, Trajectory
from mocobot_sim.trial.truth import GroundTruth

Json = dict[str, Any]
GAIN = 38.0
"""Decrease of chi-square by an effect that is detected about nine times in ten."""
LIMIT_PUSH_S = 1.0
"""Duration of the pushes whose detection limits are stated [s]; shorter pushes need more force. Chosen."""
EVERY_S = 5.0
"""Time between the pushes over which the median of the detection limit is taken [s]. Chosen."""
FORCE = {"force_x_N", "force_y_N", "force_z_N"}
TETHER = FORCE | {"stiffness_N_per_m"}
NEEDED = {"slosh": {"mass_kg"}, "tether": TETHER, "payload_tether": TETHER, "payload_mass": {"mass_kg"}}
"""Parameters whose detection limits are required to draw an effect, by cause."""
PARALLEL = float(np.cos(np.deg2rad(10.0)))
"""Cosine of the angle within which two gimbal axes at home count as parallel; their friction cannot be told apart.
Chosen: 10 deg."""
UNDECIDABLE = {("theta_zero", 3)}
"""Pairs of cause and joint that no recording can show; a campaign hides nothing there."""
REACH_M = 0.2
"""Largest distance of pushes and pendulums from the centre of mass [m]. Chosen."""
TETHER_STIFFNESS = 0.5
"""Share of a tether's size in its stiffness; the force at home has the rest, so that their squares add up to 1.
Chosen."""
PUSH_S = (0.5, 2.0)
"""Shortest and longest hidden push [s]. Chosen."""
DAMPING_RATIO = 0.05
"""Damping ratio of a hidden pendulum. Chosen."""
SPREAD_IN_UNCALIBRATED = ("phi_zero", "theta_zero", "link_length", "sea_scale", "sea_bias")
"""Causes that act on every robot of an uncalibrated team so strongly that a further one would not stand out."""


def pushes(rig: TeamRig, tolerance: Mapping[str, float]) -> list[Candidate]:
    """Make candidates for a push of ``LIMIT_PUSH_S`` every ``EVERY_S`` in all trials."""
    spans = [(t, linear.reduction.time) for t, linear in enumerate(rig.linear)]
    return [
        CAUSES["push"].event(tolerance, Transient(trial, float(start), LIMIT_PUSH_S))
        for trial, time in spans
        for start in np.arange(time[0] + 1.0, time[-1] - LIMIT_PUSH_S, EVERY_S)
    ]


def push_limits(outcome: TeamOutcome, tolerance: Mapping[str, float]) -> list[Json]:
    """Compute the detection limit of a push in every trial, including its tolerance, as the median over instants.

    Returns:
        {trial, parameters: {name: size or None}} for every trial that is long enough; trials count from 1.
    """
    problem, p = outcome.problem, outcome.state.posterior
    cells, events = problem.cells, pushes(outcome.rig, tolerance)
    count, found = cells.count, dict[int, list[Array]]()
    placed = [problem.place(problem.group_of(event, 0.0)) for event in events]
    wider = Posterior(cells, np.append(p.prior, np.zeros(cells.count - len(p.prior))), p.variance)
    for event, group in zip(events, placed, strict=True):
        assert event.transient is not None
        tolerated = [parameter.tolerance for parameter in event.parameters]
        size = np.sqrt(GAIN) * np.hypot(wider.errors_of(group.columns), tolerated)
        found.setdefault(event.transient.trial + 1, []).append(size)
    cells.truncate(count)
    names = [parameter.name for parameter in events[0].parameters] if events else []
    return [
        {"trial": trial, "parameters": dict(zip(names, _medians(values), strict=True))}
        for trial, values in sorted(found.items())
    ]


def _medians(values: Sequence[Array]) -> list[float | None]:
    return [float(m) if np.isfinite(m) else None for m in np.median(values, axis=0)]


@dataclass(frozen=True)
class MeasuredLimits:
    """Detection limits from the result of a clean set.

    Attributes:
        places: limits of a diagnosis, each {cause, robot, joint, parameters: {name: size or None}}.
        pushes: limits of ``push_limits``, each {trial, parameters}.
    """

    places: Sequence[Json]
    pushes: Sequence[Json]

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """Return the limits of a cause at a place by parameter; empty if the recordings cannot show it."""
        entries = self.pushes if cause == "push" else [e for e in self.places if e["cause"] == cause]
        here = (trial,) if cause == "push" else (robot, joint)
        keys = ("trial",) if cause == "push" else ("robot", "joint")
        for entry in entries:
            if tuple(entry[key] for key in keys) == here:
                return {name: size for name, size in entry["parameters"].items() if size is not None}
        return {}

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """Return the length of the pendulum [m] and the detection limit of its mass [kg]."""
        return CAUSES["slosh"].shapes[0]["length_m"], self.at("slosh")["mass_kg"]

    def where(self, cause: str, moving: Sequence[int]) -> list[tuple[int | None, int | None]]:
        """List robot and joint of all places where a cause is detectable and can be hidden.

        Args:
            cause: name of the cause.
            moving: trials (from 1) in which a push may act.
        """
        if cause == "push":
            told = [set(self.at(cause, trial=trial)) >= FORCE for trial in moving]
            return [(None, None)] if told and all(told) else []
        places = [(entry["robot"], entry["joint"]) for entry in self.places if entry["cause"] == cause]
        return [place for place in places if self._shows(cause, place)]

    def _shows(self, cause: str, place: tuple[int | None, int | None]) -> bool:
        seen = set(self.at(cause, *place))
        return bool(seen) and NEEDED.get(cause, set()) <= seen


@dataclass(frozen=True)
class Ground:
    """A team without hidden effects, and the motion of its trials.

    Attributes:
        robots: number of robots.
        p_1c: centre of mass in {1} [m], shape (3,).
        moving: trial number (from 1), begin and end of motion [s].
        limits: detection limits; the sizes of effects are multiples of them.
    """

    robots: int
    p_1c: Array
    moving: Sequence[tuple[int, float, float]]
    limits: Any

    @classmethod
    def of(cls, scene: TeamScene, trajectories: Sequence[Trajectory], limits: Any) -> "Ground":
        """Build it from a scene, the commands of its trials and its detection limits."""
        return cls(scene.robots, GroundTruth.of(scene).p_1c, moving_intervals(trajectories), limits)


def moving_intervals(trajectories: Sequence[Trajectory]) -> list[tuple[int, float, float]]:
    """List trial number (from 1), begin and end of motion [s] of every trial except static ones."""
    return [
        (number, SETTLE_S, trajectory.duration_s - SETTLE_S)
        for number, trajectory in enumerate(trajectories, start=1)
        if trajectory.trial != "static"
    ]


def gimbal_axes(team: TeamScene) -> list[list[list[float]]]:
    """Return the axes of gimbal joints 1, 2, 3 (z, y, x) at home in {1}, one per row and robot, shape (N, 3, 3)."""
    out = []
    for theta, X in zip(team.theta_home, team.X_1i, strict=True):
        flange = X.rotation * Rotation.from_euler("ZYX", theta).inv()  # rotation from {b} to {1}
        after_z = flange * Rotation.from_euler("Z", theta[0])
        after_y = after_z * Rotation.from_euler("Y", theta[1])
        axes = [flange.apply([0, 0, 1]), after_z.apply([0, 1, 0]), after_y.apply([1, 0, 0])]
        out.append(np.array(axes).tolist())
    return out


def one_axis(axes: Any, a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Whether the axes of two gimbal joints are parallel within the limit ``PARALLEL``."""
    first, second = (np.array(axes)[x["robot"] - 1, x["joint"] - 1] for x in (a, b))
    return bool(abs(first @ second) > PARALLEL)


def draw_effect(cause: str, factor: float, ground: Ground, rng: np.random.Generator) -> Effect:
    """Draw an effect of ``factor`` times the detection limit at a random place."""
    names = EFFECTS[cause].place_names()
    joints = [joint for joint in (1, 2, 3) if (cause, joint) not in UNDECIDABLE]
    robot = int(rng.integers(1, ground.robots + 1)) if "robot" in names else None
    joint = int(rng.choice(joints)) if "joint" in names else None
    return draw_at(cause, factor, robot, joint, ground, rng)


def draw_at(
    cause: str, factor: float, robot: int | None, joint: int | None, ground: Ground, rng: np.random.Generator
) -> Effect:
    """Draw an effect of ``factor`` times the detection limit at a given place."""
    if cause == "push":
        parameters = _push(factor, ground, rng)
    elif cause == "slosh":
        parameters = _slosh(factor, ground, rng)
    elif cause == "payload_mass":  # a drift, because a different mass in some trials needs several trials
        rate = factor * ground.limits.at(cause)["mass_kg"] / MASS_OVER_S * rng.choice([-1.0, 1.0])
        parameters = {"rate_kgps": float(rate)} | _vector("point", "m", _near(ground.p_1c, rng))
    elif cause == "tether":
        parameters = _tether(factor, ground.limits.at(cause, robot), np.zeros(3), rng)
    elif cause == "payload_tether":
        point = _near(ground.p_1c, rng)
        parameters = _tether(factor, ground.limits.at(cause), point, rng) | _vector("point", "m", point)
    else:
        parameters = _sized(cause, factor, ground.limits.at(cause, robot, joint), rng)
    return make_effect(cause, parameters, robot, joint)


def signed(cause: str, name: str, value: float) -> float:
    """Return the value, or its magnitude if the parameter cannot be negative."""
    low = EFFECTS[cause].ranges.get(name, (-np.inf, np.inf))[0]
    return abs(value) if low >= 0 else value


def _sized(
    cause: str, factor: float, limits: Mapping[str, float], rng: np.random.Generator
) -> dict[str, float]:
    direction = _direction(rng, len(limits))
    if cause == "link_length":  # changes a single length
        direction = np.eye(len(limits))[rng.integers(len(limits))] * rng.choice([-1.0, 1.0])
    return {
        name: signed(cause, name, float(factor * limit * d))
        for (name, limit), d in zip(limits.items(), direction, strict=True)
    }


def _push(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    number, begin, end = ground.moving[int(rng.integers(len(ground.moving)))]
    duration = rng.uniform(*PUSH_S)
    limits = ground.limits.at("push", trial=number)
    force = factor * _components("force", "N", limits) * _direction(rng, 3)
    return {"trial": number, "start_s": rng.uniform(begin, end - duration), "duration_s": duration} | (
        _vector("force", "N", force) | _vector("point", "m", _near(ground.p_1c, rng))
    )


def _slosh(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    length_m, limit_kg = ground.limits.pendulum(rng)
    shape = {"length_m": length_m, "damping_ratio": DAMPING_RATIO}
    mass = {"mass_kg": factor * limit_kg}
    return mass | shape | _vector("point", "m", _near(ground.p_1c, rng))


def _tether(
    factor: float, limits: Mapping[str, float], point: Array, rng: np.random.Generator
) -> dict[str, float]:
    """Draw the parameters of a tether attached at ``point`` [m], which counts from {i} at home in the axes of {b}."""
    stiffness = factor * TETHER_STIFFNESS * limits["stiffness_N_per_m"]
    force = (
        factor * np.sqrt(1.0 - TETHER_STIFFNESS**2) * _components("force", "N", limits) * _direction(rng, 3)
    )
    anchor = force / stiffness + point + [0.0, 0.0, omnid_design().home_height_m]
    return {"stiffness_N_per_m": float(stiffness)} | _vector("anchor", "m", anchor)


def _direction(rng: np.random.Generator, size: int) -> Array:
    draw = rng.standard_normal(size)
    return draw / np.linalg.norm(draw)


def _near(point: Array, rng: np.random.Generator) -> Array:
    return point + REACH_M * np.cbrt(rng.uniform()) * _direction(rng, 3)


def _components(name: str, unit: str, limits: Mapping[str, float]) -> Array:
    return np.array([limits[f"{name}_{axis}_{unit}"] for axis in "xyz"])


def _vector(name: str, unit: str, values: Array) -> dict[str, float]:
    return {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}


@dataclass(frozen=True)
class GimbalFriction(listed.GimbalFriction):
    """Gimbal friction with a single constraint row: faster by a third for nine gimbals, but stiction creeps."""

    rows: ClassVar[int] = 1


def draw_background(
    robots: int,
    rng: np.random.Generator,
    times: float = 1.0,
    tolerances: Mapping[str, Mapping[str, float]] | None = None,
) -> list[Effect]:
    """Draw tolerated deviations of every cause at every place from normal distributions.

    Parameters that cannot be negative get the magnitude of the draw. Pushes are left out, because their tolerance
    represents friction at rest.

    Args:
        robots: number of robots.
        rng: source of random numbers.
        times: factor on all tolerances.
        tolerances: standard deviations by cause and parameter, 0 for an exact one; None for the defaults.
    """
    out = []
    for cause, deviations in (default_tolerances() if tolerances is None else tolerances).items():
        if cause == "push" or not any(deviations.values()):
            continue
        names = EFFECTS[cause].place_names()
        places = product(
            range(1, robots + 1) if "robot" in names else [None], (1, 2, 3) if "joint" in names else [None]
        )
        for robot, joint in places:
            values = {
                name: signed(cause, name, float(times * deviation * rng.standard_normal()))
                for name, deviation in deviations.items()
            }
            out.append(make_effect(cause, values, robot, joint))
    return out


def cheaper(effects: list[Effect]) -> list[Effect]:
    """Replace gimbal friction by the version that simulates faster."""
    return [
        GimbalFriction(**vars(effect)) if isinstance(effect, listed.GimbalFriction) else effect
        for effect in effects
    ]
