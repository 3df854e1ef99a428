"""Sets of recordings of one team with something hidden in it, and what that is.

recordings, truth = generate(7, "x1", [("sea_bias", 6.0)], "b")
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from estimator.arm.design import OmnidDesign, load_design
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from independent.bodies import MODELS, ROBOTS, TIMES, AsBuilt, Payload, draw_as_built, load_payload
from independent.draw import Setting, draw_hidden
from independent.effects import Effect, Hidden
from independent.numerics import Array, lagged, play
from independent.team import MOTIONS, Bases, Motion, Truth, carry, place_bases, scene_of

RATE_HZ = 100.0


@dataclass(frozen=True)
class Sensors:
    """What one set of recordings was read with.

    Attributes:
        phi_step_rad, theta_step_rad: encoders' steps; 0: none.
        jitter_steps: white noise before rounding, in encoder steps.
        torque_noise_Nm: white noise.
        coloured_noise_Nm, colour: of first-order noise at ``RATE_HZ``: standard deviation, and share kept per sample.
        torque_step_Nm: rounding; 0: none.
        offsets: where the channels' grids lie, in steps, shape (3, N, 3): phi, theta, torque.
    """

    phi_step_rad: float = 0.0
    theta_step_rad: float = 0.0
    jitter_steps: float = 0.0
    torque_noise_Nm: float = 0.0
    coloured_noise_Nm: float = 0.0
    colour: float = 0.0
    torque_step_Nm: float = 0.0
    offsets: tuple[float, ...] = (0.0,) * 27


IDEAL = Sensors()


def draw_sensors(rng: np.random.Generator, noise: str) -> Sensors:
    """Encoders of 14 to 18 bits, torques with noise of milli-newton-metres and rounding.

    Args:
        rng: their source.
        noise: ``white``, ``coloured`` (as well), or ``drawn``: coloured in half of the sets.
    """
    bits = rng.integers(14, 19, 2)
    white = rng.uniform(0.005, 0.020)
    amount, often = rng.uniform(0.3, 1.0), rng.random() < 0.5
    coloured = noise == "coloured" or (noise == "drawn" and often)
    return Sensors(
        phi_step_rad=float(2 * np.pi / 2 ** bits[0]),
        theta_step_rad=float(2 * np.pi / 2 ** bits[1]),
        jitter_steps=float(rng.uniform(0, 1)),
        torque_noise_Nm=float(white),
        coloured_noise_Nm=float(white * amount * coloured),
        colour=float(rng.uniform(0.5, 0.95)),
        torque_step_Nm=float(rng.uniform(0.001, 0.010)),
        offsets=tuple(rng.uniform(-0.5, 0.5, 27).tolist()),
    )


def spring_readings(torque: Array, robots: AsBuilt, effects: Sequence[Effect], design: OmnidDesign) -> Array:
    """Design stiffness times the springs' deflection [N m], on the fine grid, shape (Q, N, 3)."""
    carried = play(torque, robots["sea_hysteresis"])
    for effect in effects:
        # Forms of springs: whatever stands beside the spring is taken off before its own law.
        if (found := effect.spring(carried, design.sea_stiffness_Nm_per_rad)) is not None:
            carried[:, found[0], found[1]] = found[2]
    k = design.sea_stiffness_Nm_per_rad * (1 + robots["sea_scale"])
    deflection = carried / k
    for _ in range(8):  # Newton's method on k d + k3 d^3
        cubic = robots["sea_hardening"]
        deflection -= (k * deflection + cubic * deflection**3 - carried) / (k + 3 * cubic * deflection**2)
    return design.sea_stiffness_Nm_per_rad * deflection


def log(
    rng: np.random.Generator,
    truth: Truth,
    robots: AsBuilt,
    effects: Sequence[Effect],
    sensors: Sensors,
    design: OmnidDesign,
    duration_s: float,
) -> tuple[Array, Array, Array, Array]:
    """Times [s] and readings of phi, theta [rad] and torque [N m] at ``RATE_HZ``, shapes (Q,) and (Q, N, 3).

    Args:
        rng: source of the noise.
        truth: the trial.
        robots: how the robots are off.
        effects: what else is hidden.
        sensors: the set's.
        design: the robots' numbers.
        duration_s: of the recording [s].
    """
    torque = spring_readings(truth.torque, robots, effects, design) + robots["sea_bias"]
    for i in range(ROBOTS):
        for joint in range(3):
            lag = float(robots["sensor_lag"][i, joint])
            torque[:, i, joint] = lagged(torque[:, i, joint], lag)
        torque[:, i] = lagged(torque[:, i], float(robots["torque_lag"][i, 0]))
    for effect in effects:
        if (found := effect.sensed(torque)) is not None:
            torque[:, found[0]] = found[1]
    time = np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ
    phi, theta, read = (np.empty((len(time), ROBOTS, 3)) for _ in range(3))
    for i in range(ROBOTS):
        late = time - float(robots["clock_delay"][i, 0])
        phi[:, i] = CubicSpline(truth.scene.time, truth.phi[:, i])(late)
        theta[:, i] = CubicSpline(truth.scene.time, truth.theta[:, i])(late)
        read[:, i] = CubicSpline(truth.scene.time, torque[:, i])(late - float(robots["torque_skew"][i, 0]))
    offsets = np.reshape(sensors.offsets, (3, ROBOTS, 3))
    phi = _rounded(rng, phi + robots["phi_zero"], sensors.phi_step_rad, sensors.jitter_steps, offsets[0])
    theta = _rounded(
        rng, theta + robots["theta_zero"], sensors.theta_step_rad, sensors.jitter_steps, offsets[1]
    )
    read += rng.normal(0.0, 1.0, read.shape) * sensors.torque_noise_Nm
    if sensors.coloured_noise_Nm:
        # The first samples are dropped, so that the noise is stationary from the start.
        drive = rng.normal(0.0, 1.0, (200 + len(read), ROBOTS, 3)) * np.sqrt(1 - sensors.colour**2)
        noise = np.asarray(lfilter([1.0], [1.0, -sensors.colour], drive, axis=0))
        read += sensors.coloured_noise_Nm * noise[200:]
    return time, phi, theta, _rounded(rng, read, sensors.torque_step_Nm, 0.0, offsets[2])


def _rounded(rng: np.random.Generator, x: Array, step: float, jitter: float, offset: Array) -> Array:
    if step <= 0:
        return x
    noisy = x / step - offset + rng.normal(0.0, 1.0, x.shape) * jitter
    return (np.round(noisy) + offset) * step


SOURCE = "independent generator"
KINDS = ("random", "random", "periodic", "static")
Noise = Literal["white", "coloured", "drawn"]
_SHARE_OF_RANGE, _SHARE_OF_TORQUE = 0.95, 0.95


def generate(
    seed: int,
    background: str,
    hidden: Sequence[tuple[str, float]],
    payload: str,
    *,
    ideal: bool = False,
    noise: Noise = "drawn",
    kinds: Sequence[str] = KINDS,
) -> tuple[list[Recording], dict[str, Any]]:
    """Trials of one team: two random ones, one periodic, one static.

    Args:
        seed: of everything that is drawn; the same seed gives the same bits, and what is hidden changes neither
            motion nor background nor noise (unless it takes a robot to its limits: the motion is then smaller).
        background: ``x1``, ``x3``, ``x10`` or ``uncalibrated``; ``none`` for tests.
        hidden: names of ``NAMES`` with sizes, in multiples of the smallest that shows.
        payload: a, b, c or d.
        ideal: whether sensors have neither noise nor steps.
        noise: of the torques: white alone, coloured as well, or one of the two, as the seed has it.
        kinds: of the trials; ``random``, ``periodic`` or ``static`` each.

    Returns:
        The recordings, and the truth: ``mass_kg``, ``effects``, ``background``, ``units`` (none: nobody calibrated the
        robots) and ``sensors``.

    Raises:
        ValueError: a background or name that is not known, or a motion that no scale makes reachable.
    """
    if background not in TIMES:
        raise ValueError(f"background {background!r}; it must be one of {', '.join(TIMES)}")
    rngs = np.random.default_rng(seed).spawn(5 + len(hidden))
    design = load_design(MODELS / "omnid" / "design.toml")
    body = load_payload(payload)
    robots = draw_as_built(rngs[0], background)
    motions = [MOTIONS[kind](rng) for kind, rng in zip(kinds, rngs[1].spawn(len(kinds)), strict=True)]
    places = _bases(rngs[2], body, design, len(motions))
    sensors = IDEAL if ideal else draw_sensors(rngs[3], noise)
    setting = Setting(body, places[0], design, background, tuple(m.duration_s for m in motions))
    found: list[Hidden] = []
    for rng, (name, size) in zip(rngs[5:], hidden, strict=True):
        found.append(draw_hidden(rng, name, size, setting))
        found[-1].effect.build(robots)
    recordings = []
    for k, (motion, rng) in enumerate(zip(motions, rngs[4].spawn(len(motions)), strict=True)):
        effects = [h.effect for h in found]
        share, reading = rng.spawn(2)
        truth, motion = _within_limits(k + 1, motion, share, body, places[k], design, robots, effects)
        samples = log(reading, truth, robots, effects, sensors, design, motion.duration_s)
        recordings.append(_recording(samples, motion.kind, design, seed, f"trial{k + 1}"))
    told = [h.to_dict(size) for h, (_, size) in zip(found, hidden, strict=True)]
    return recordings, {
        "mass_kg": body.mass_kg, "effects": told, "units": [],
        "background": [_plain(robots, i) for i in range(len(places[0].p_Wb))],
        "sensors": asdict(sensors),
    }  # fmt: skip


def _bases(rng: np.random.Generator, payload: Payload, design: OmnidDesign, trials: int) -> list[Bases]:
    """The same for all trials, or, as often, new for each."""
    again = rng.random() < 0.5
    first = place_bases(rng, payload, design)
    later = (place_bases(rng, payload, design, first) if again else first for _ in range(trials - 1))
    return [first, *later]


def _within_limits(
    trial: int,
    motion: Motion,
    rng: np.random.Generator,
    payload: Payload,
    bases: Bases,
    design: OmnidDesign,
    robots: AsBuilt,
    effects: Sequence[Effect],
) -> tuple[Truth, Motion]:
    """A trial whose angles and torques the robots can have; the motion gets smaller until they do."""
    state = rng.bit_generator.state
    for _ in range(6):
        rng.bit_generator.state = state
        scene = scene_of(trial, motion, payload, bases, design)
        truth = carry(rng, scene, design, robots, effects, squeezing=motion.kind != "static")
        if _fits(truth, design):
            return truth, motion
        motion = motion.scaled(0.8)
    raise ValueError(
        f"trial {trial}: no scale of the motion keeps angles and torques within the robots' limits"
    )


def _fits(truth: Truth, design: OmnidDesign) -> bool:
    low, high = design.phi_min_rad * _SHARE_OF_RANGE, design.phi_max_rad * _SHARE_OF_RANGE
    return bool(
        np.all((truth.phi > low) & (truth.phi < high))
        and np.abs(truth.theta).max() < design.gimbal_limit_rad * _SHARE_OF_RANGE
        # A recording may hold twice the limit; heavy shares of payload (c) come near it while it moves.
        and np.abs(truth.torque).max() < 1.2 * design.torque_limit_Nm * _SHARE_OF_TORQUE
    )


def _recording(
    samples: tuple[Array, Array, Array, Array], kind: str, design: OmnidDesign, seed: int, name: str
) -> Recording:
    metadata = RecordingMetadata(
        robots=samples[1].shape[1], rate_hz=RATE_HZ, trial=kind, source=SOURCE, payload=None,
        seed=seed, design=design,
    )  # fmt: skip
    return Recording(*samples, None, metadata, name)


def _plain(robots: AsBuilt, robot: int) -> dict[str, list[float]]:
    return {name: values[robot].tolist() for name, values in robots.items()}
