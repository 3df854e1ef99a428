"""Healthy and faulty teams of the shipped payloads, as any lab's logger has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from mocobot.campaign.effects import Ground, draw_background, draw_effect, gimbal_axes
from mocobot_logs.convert import Labels, convert
from mocobot_logs.log import CHANNELS, REF, Level, Samples
from mocobot_logs.resample import RATE_HZ as CONVERTED_HZ
from mocobot_sim.effects import Effect, apply_effects, effect_to_dict
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import Trajectory, random_vias, sphere_motion, static_orientations
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth

LIMITS: dict[str, dict[str, float]] = {
    "phi_zero": {"zero_rad": 6.6e-4},
    "theta_zero": {"zero_rad": 6.2e-4},
    "link_length": {"proximal_m": 1.3e-4, "rod_m": 1.5e-4, "base_radius_m": 1.4e-4},
    "base_tilt": {"roll_rad": 7.0e-4, "pitch_rad": 7.0e-4},
    "base_creep": {"x_mps": 1.7e-7, "y_mps": 1.6e-7},
    "base_compliance": {"compliance_m_per_N": 7.1e-7},
    "grasp_flex": {"compliance_m_per_N": 7.1e-7},
    "grasp_play": {"play_m": 1.9e-5},
    "sea_bias": {"bias_Nm": 0.020},
    "sea_scale": {"scale": 6.6e-3},
    "sea_hardening": {"cubic_Nm_per_rad3": 24.0},
    "sea_hysteresis": {"friction_Nm": 0.012},
    "joint_friction": {"coulomb_Nm": 0.012, "viscous_Nms_per_rad": 0.013},
    "gimbal_friction": {"coulomb_Nm": 0.017, "viscous_Nms_per_rad": 0.038},
    "torque_skew": {"delay_s": 8.9e-4},
    "torque_lag": {"time_constant_s": 8.9e-4},
    "sensor_lag": {"time_constant_s": 9.0e-4},
    "clock_delay": {"delay_s": 7.6e-5},
    "tether": {"force_x_N": 0.047, "force_y_N": 0.062, "force_z_N": 0.10, "stiffness_N_per_m": 0.15},
    "payload_tether": {"force_x_N": 0.047, "force_y_N": 0.062, "force_z_N": 0.10, "stiffness_N_per_m": 0.15},
    "push": {"force_x_N": 0.13, "force_y_N": 0.13, "force_z_N": 0.14},
    "drag": {"coefficient_Ns_per_m": 0.33},
    "slosh": {"mass_kg": 3.4e-3},
    "payload_mass": {"mass_kg": 4.2e-3},  # in a minute
    "encoder_play": {"play_rad": 5.0e-4},
}

PENDULUM_LENGTHS_M = (0.08, 0.11, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)
PENDULUM_LIMITS_KG = (4.9e-3, 5.2e-3, 3.8e-3, 3.4e-3, 4.1e-3, 5.0e-3, 5.5e-3, 6.4e-3, 6.9e-3, 6.8e-3)
"""Mass of a pendulum of each length, damping ratio 0.05: the trials excite a slow one less."""


def pendulum_limit_kg(length_m: float) -> float:
    """Detection limit of a pendulum's mass [kg], straight lines between the measured lengths."""
    return float(np.interp(length_m, PENDULUM_LENGTHS_M, PENDULUM_LIMITS_KG))


@dataclass(frozen=True)
class Schedule:
    """Trials of one data set, random ones first; the default lasts 164 s or a little more.

    Attributes:
        randoms: number of random trials.
        vias: vias of each.
        periodic_s: length of the periodic trial's motion [s]; None for no periodic trial.
        hold_s: time at each hold of the static trial [s]; None for no static trial.
    """

    randoms: int = 2
    vias: int = 27
    periodic_s: float | None = 35.0
    hold_s: float | None = 4.5

    def trajectories(self, scene: TeamScene, rng: np.random.Generator) -> list[Trajectory]:
        """Commands of every trial."""
        home = scene.wrist_home_b
        out = [random_vias(home, rng, vias=self.vias) for _ in range(self.randoms)]
        if self.periodic_s is not None:
            out.append(sphere_motion(home, scene.X_1i, duration_s=self.periodic_s, rng=rng))
        if self.hold_s is not None:
            out.append(static_orientations(home, scene.X_1i, hold_s=self.hold_s))
        return out


SHORT = (
    Schedule(randoms=2, vias=20, periodic_s=None, hold_s=None),
    Schedule(randoms=1, vias=20, periodic_s=30.0, hold_s=None),
    Schedule(randoms=1, vias=20, periodic_s=None, hold_s=4.5),
)
"""Two trials: as much as a first log may have."""


Array = NDArray[np.float64]

RATES_HZ = (50.0, 80.0, 100.0, 125.0, 200.0, 250.0, 400.0, 500.0, 1000.0)
LEAST_SPACING = 0.05
"""Share of a period that two samples are apart at least, however large the jitter."""


@dataclass(frozen=True, eq=False)
class MadeLog:
    """A log in memory; attributes as in ``LogSource``."""

    name: str
    streams: tuple[Samples, ...]
    level: Level = "joint"
    channels: tuple[str, ...] = (*CHANNELS["joint"], *REF)
    metadata: RecordingMetadata | None = None
    notes: tuple[str, ...] = ()

    @property
    def robots(self) -> int:
        return len(self.streams)

    @property
    def size(self) -> int:
        return len(self.streams)

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Every robot's samples."""
        for robot, stream in enumerate(self.streams):
            yield robot, stream
            advance(1)


@dataclass(frozen=True)
class Logger:
    """How a team is recorded.

    Attributes:
        rate_hz: samples a second [Hz].
        jitter_s: standard deviation of the instants at which samples are taken; the stamps tell them [s].
        drops: share of samples that are lost, each by itself.
        stagger_s: how much later each robot begins a period than the one before [s].
        offset_s, drift: by which each robot's clock differs from the one before, at the start [s] and by its rate.
        encoder_bits: resolution of every encoder, per turn; None for continuous.
        tau_noise_Nm: standard deviation of white torque noise before rounding [N m].
        tau_step_Nm: torque resolution [N m]; 0 for continuous.
        converted_hz: sampling rate of the recording that ``mocobot convert`` is asked for.
    """

    rate_hz: float = 100.0
    jitter_s: float = 0.0
    drops: float = 0.0
    stagger_s: float = 0.0
    offset_s: float = 0.0
    drift: float = 0.0
    encoder_bits: int | None = 16
    tau_noise_Nm: float = 0.01
    tau_step_Nm: float = 0.01
    converted_hz: float = CONVERTED_HZ

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Logger:
        """Any logger that a lab may have."""
        rate_hz = float(rng.choice(RATES_HZ))
        return cls(
            rate_hz=rate_hz,
            jitter_s=float(rng.choice([0.0, 1.0]) * np.exp(rng.uniform(np.log(5e-5), np.log(2e-3)))),
            drops=float(rng.choice([0.0, rng.uniform(0.0, 0.05)])),
            stagger_s=float(rng.choice([0.0, rng.uniform(0.0, 0.01)])),
            offset_s=float(rng.choice([0.0, rng.uniform(-0.05, 0.05)])),
            drift=float(rng.choice([0.0, rng.uniform(-5e-5, 5e-5)])),
            encoder_bits=int(rng.integers(12, 21)),
            tau_noise_Nm=float(np.exp(rng.uniform(np.log(0.003), np.log(0.05)))),
            tau_step_Nm=float(rng.choice([0.0, 0.001, 0.01, 0.02])),
        )

    def logged(self, trial: TrialLog, rng: np.random.Generator, name: str = "logged") -> MadeLog:
        """A trial as the lab's recorder has it; arguments as of ``recorded``."""
        return MadeLog(name, tuple(self._stream(trial, robot, rng) for robot in range(trial.robots)))

    def recorded(self, trial: TrialLog, rng: np.random.Generator, name: str = "logged") -> Recording:
        """A trial, logged and brought onto one grid as ``mocobot convert`` does it.

        Args:
            trial: what truly happened.
            rng: source of jitter, losses, noise and of where rounding grids lie.
            name: how messages call the log.
        """
        log = self.logged(trial, rng, name)
        labels = Labels(trial=trial.trial)
        correct = bool(self.offset_s or self.drift)
        converted = convert(log, labels, omnid_design(), rate_hz=self.converted_hz, correct=correct)
        recording = converted.recording
        control = trial.gains.to_dict() | {"feed_forward_N": trial.feed_forward.tolist()}
        return replace(recording, metadata=replace(recording.metadata, control=control))

    def _stream(self, trial: TrialLog, robot: int, rng: np.random.Generator) -> Samples:
        sensed, unit = trial.sensed, trial.units[robot]
        clock = np.arange(len(sensed.phi)) / sensed.rate_hz
        at = self._instants(clock[-1], robot, rng)
        clock_s = trial.sensors.of("clock_delay_s", trial.robots)[robot]
        torque_s = clock_s + trial.sensors.of("torque_delay_s", trial.robots)[robot]
        encoder = 2.0 * np.pi / 2**self.encoder_bits if self.encoder_bits else 0.0
        parts = []
        for values, delay_s, zero, noise, step in (
            (sensed.phi, clock_s, unit.phi_zero_rad, 0.0, encoder),
            (sensed.theta, clock_s, unit.theta_zero_rad, 0.0, encoder),
            (sensed.tau, torque_s, unit.tau_zero_Nm, self.tau_noise_Nm, self.tau_step_Nm),
        ):
            read = CubicSpline(clock, values[:, robot])(np.clip(at - delay_s, clock[0], clock[-1])) + zero
            read += noise * rng.standard_normal(read.shape)
            grid = step * rng.uniform(-0.5, 0.5, 3)
            parts.append(np.round((read + grid) / step) * step - grid if step else read)
        commands = CubicSpline(trial.time, trial.ref_b[:, robot], bc_type="clamped")
        parts.append(commands(np.minimum(at, trial.time[-1])))
        stamp = at * (1.0 + robot * self.drift) + robot * self.offset_s
        return Samples(np.rint((stamp + 1.0) * 1e9).astype(np.int64), np.concatenate(parts, axis=1))

    def _instants(self, end_s: float, robot: int, rng: np.random.Generator) -> Array:
        """When one robot's samples are taken [s]."""
        period = 1.0 / self.rate_hz
        at = np.arange((robot * self.stagger_s) % period, end_s, period)
        # A late sample does not change the place of the next, but samples stay in order.
        at = np.sort(at + self.jitter_s * rng.standard_normal(len(at))) if self.jitter_s else at
        at = at[np.concatenate([[True], np.diff(at) > LEAST_SPACING * period])]
        kept = rng.uniform(size=len(at)) >= self.drops
        kept[[0, -1]] = True
        return at[kept & (at >= 0) & (at <= end_s)]


LENGTHS_M = (0.08, 0.5)
"""Lengths of pendulums."""


class Tabled:
    """Detection limits of the tables."""

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """Limits of a cause, the same at all its places."""
        return LIMITS[cause]

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """A length, and its limit."""
        length = rng.uniform(*LENGTHS_M)
        return length, pendulum_limit_kg(length)


def ground_of(robots: int, p_1c: NDArray[np.float64], moving: Sequence[tuple[int, float, float]]) -> Ground:
    """A ground with the tables' limits."""
    return Ground(robots, p_1c, moving, Tabled())


class Sealed:
    """The truth about one data set; it opens only against a verdict."""

    def __init__(self, truth: Mapping[str, Any]) -> None:
        """Seal it."""
        self._truth = dict(truth)

    def open(self, verdict: Mapping[str, Any] | None) -> dict[str, Any]:
        """The truth: ``payload``, ``effects`` and ``background``, ``gimbal_axes_1`` at home, shape (N, 3, 3).

        Raises:
            ValueError: there is no verdict yet.
        """
        if verdict is None:
            raise ValueError("the truth stays sealed until there is a verdict")
        return dict(self._truth)


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
