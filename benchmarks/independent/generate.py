"""Sets of recordings of one team with something hidden in it, and what that is.

recordings, truth = generate(7, "x1", [("sea_bias", 6.0)], "b")
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from estimator.arm.design import OmnidDesign, load_design
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from independent.as_built import TIMES, AsBuilt, draw_as_built
from independent.effects.effect import Effect, Hidden
from independent.effects.registry import ANSWERS, FORMS, NAMES, Setting, draw_hidden
from independent.motion import MOTIONS, Motion
from independent.numerics import Array
from independent.payload import MODELS, Payload, load_payload
from independent.sensors import IDEAL, RATE_HZ, draw_sensors, log
from independent.team import Bases, Truth, carry, place_bases, scene_of

__all__ = ["ANSWERS", "FORMS", "NAMES", "generate"]

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
