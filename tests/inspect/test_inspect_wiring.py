"""Mistakes in the wiring: each put in once is named with robot and channels; true recordings are left alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimator.arm.delta import wrist_of
from estimator.arm.unit import Arms
from estimator.recording.model import Recording
from miswired import MISTAKES, Miswired, miswire
from mocobot_inspect.signals import Signals, signals_of
from mocobot_inspect.team_wiring import SUSPICIOUS, Misfit, Team, Wiring, check_wiring
from mocobot_logs.log import Level
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog
from omnid_design import DESIGN
from uncalibrated_team import uncalibrated

ENCODER = 2 * np.pi / 2**16 / np.sqrt(12)
TORQUE = 0.01 * np.sqrt(1 + 1 / 12)


@pytest.fixture(scope="module")
def trials(random_a: TrialLog) -> dict[str, Recording]:
    """A random trial each of payloads (a) and (b)."""
    rng = np.random.default_rng(8)
    b = build_team("b")
    logs = {"a": random_a, "b": run_trial(b, random_vias(b.wrist_home_b, rng, vias=10))}
    return {name: measure(log, PRESETS["nominal"], rng) for name, log in logs.items()}


def samples(recording: Recording, level: Level) -> np.ndarray:
    """As a log tells them: wrists and forces are worked out by robots' own controllers, which know the design."""
    position, effort = recording.phi, recording.tau
    if level == "wrist":
        position, effort = wrist_of(position, effort, DESIGN)
    return np.concatenate([position, recording.theta, effort], axis=2)


def signals(recording: Recording, level: Level = "joint") -> Signals:
    """What is judged of a recording whose sensors' noise is known."""
    noise = [0.2 * ENCODER, ENCODER, 5 * TORQUE] if level == "wrist" else [ENCODER, ENCODER, TORQUE]
    return signals_of(level, [samples(recording, level)], np.tile(np.repeat(noise, 3), (3, 1)))


def look(found: Signals) -> Wiring:
    return check_wiring(found, DESIGN, look_for_hidden=False)


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.name)
def test_a_mistake_is_named(trials: dict[str, Recording], mistake: Miswired) -> None:
    wiring = look(signals(miswire(trials["a"], mistake.edit)))
    (found,) = wiring.found
    assert found.mistake.kind == mistake.kind
    assert sorted(robot + 1 for robot in found.mistake.robots) == list(mistake.robots)
    assert set(found.mistake.channels) == set(mistake.channels)
    assert mistake.words in found.mistake.sentence
    assert found.before > 15 * found.after
    assert wiring.undone.total < 0.05


@pytest.mark.parametrize("payload", ["a", "b"])
@pytest.mark.parametrize("level", ["joint", "wrist"])
def test_true_recordings_are_left_alone(trials: dict[str, Recording], payload: str, level: Level) -> None:
    wiring = look(signals(trials[payload], level))
    assert wiring.found == ()
    assert wiring.as_is.total < 0.05
    assert wiring.as_is.determined
    assert wiring.as_is.faults == ()


def test_disagreements_are_in_units_of_what_poorly_calibrated_robots_show(
    trials: dict[str, Recording],
) -> None:
    """Robot 2's encoders and torques are off by much more than noise."""

    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        theta[:, 1] *= 1.2
        theta[:, 1, 1] += 0.05
        phi[:, 1] *= 1.05
        tau[:, 1] *= 1.2

    found = look(signals(miswire(trials["a"], edit))).as_is
    tolerances = {"rotation": 0.01, "velocity": 0.03, "tilt": 0.02, "force": 0.03, "moment": 0.025}
    assert set(found.scaled) == set(tolerances)
    for name, tolerance in tolerances.items():
        assert found.scaled[name] == pytest.approx(found.relative[name] / tolerance, rel=0.05)
    assert found.total == pytest.approx(np.mean(np.square(list(found.scaled.values()))))


def test_two_mistakes_are_both_named(trials: dict[str, Recording]) -> None:
    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        theta *= 180 / np.pi
        tau[:, 2] *= -1

    wiring = look(signals(miswire(trials["a"], edit)))
    sentences = {found.mistake.sentence for found in wiring.found}
    assert sentences == {"all robots: theta is in degrees, not radians", "robot 3: tau has the wrong sign"}
    assert wiring.undone.total < 0.05


def test_renumbered_robots_cannot_be_seen(trials: dict[str, Recording]) -> None:
    def edit(*groups: np.ndarray) -> None:
        for group in groups:
            group[:, [0, 2]] = group[:, [2, 0]]

    wiring = look(signals(miswire(trials["b"], edit)))
    assert wiring.found == ()
    assert wiring.as_is.total < 0.05


def test_a_mirror_image_is_not_told_apart(trials: dict[str, Recording]) -> None:
    """Legs 2 and 3 exchanged everywhere is the whole team seen in a mirror, and so are two gimbal signs."""

    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        phi[..., [1, 2]] = phi[..., [2, 1]]
        tau[..., [1, 2]] = tau[..., [2, 1]]

    (found,) = look(signals(miswire(trials["a"], edit))).found
    either = {m.sentence for m in (found.mistake, *found.alternatives)}
    assert either == {
        "all robots: phi2 and phi3 are exchanged and tau2 and tau3 are exchanged",
        "all robots: theta_z and theta_x have the wrong sign",
    }


def test_what_no_mistake_explains_is_not_explained(trials: dict[str, Recording]) -> None:
    """One robot carries something else: its angles are those of another trial."""

    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        theta[:, 1] = np.roll(theta[:, 1], 700, axis=0)
        phi[:, 1] = np.roll(phi[:, 1], -500, axis=0)

    wiring = look(signals(miswire(trials["b"], edit)))
    assert wiring.found == ()
    assert wiring.undone.suspicious
    assert wiring.as_is.total > 10 * SUSPICIOUS


# Wrist level


def wrist_edits(name: str, found: Signals) -> Signals:
    """Mistakes that only a log of wrist positions can have, put into filtered channels by hand."""
    position, effort = found.position.values.copy(), found.effort.values.copy()
    if name == "mm":
        position *= 1e3
    elif name == "force sign":
        effort[:, :, 1] *= -1
    elif name == "h and force axes":
        position[:, :, 2] = position[:, :, 2][..., [1, 0, 2]]
        effort[:, :, 2] = effort[:, :, 2][..., [1, 0, 2]]
    elif name == "from home":
        position[0] -= [0.0, 0.0, DESIGN.home_height_m]
    elif name == "force axes":
        effort[:, :, 0] = effort[:, :, 0][..., [2, 1, 0]]
    return dataclasses.replace(
        found,
        position=dataclasses.replace(found.position, values=position),
        effort=dataclasses.replace(found.effort, values=effort),
    )


@pytest.mark.parametrize("payload", ["a", "b"])
@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("mm", "all robots: h is in millimetres, not metres"),
        ("force sign", "robot 2: force has the wrong sign"),
        ("h and force axes", "robot 3: h_x and h_y are exchanged and force_x and force_y are exchanged"),
        ("from home", "all robots: h is measured from the home posture at (0, 0, 0.355) m"),
        ("force axes", "robot 1: force_x and force_z are exchanged"),
    ],
)
def test_mistakes_at_wrist_level(
    trials: dict[str, Recording], payload: str, name: str, sentence: str
) -> None:
    wiring = look(wrist_edits(name, signals(trials[payload], "wrist")))
    (found,) = wiring.found
    assert sentence in {m.sentence for m in (found.mistake, *found.alternatives)}
    assert wiring.undone.total < 0.05


# What the data can tell


def test_mistakes_that_would_not_show_are_said(trials: dict[str, Recording]) -> None:
    """With legs loaded alike all the time, the order of torques is anybody's guess."""

    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        tau[:, 0] = tau[:, 0].mean(axis=-1, keepdims=True)

    wiring = check_wiring(signals(miswire(trials["a"], edit)), DESIGN)
    sentences = {mistake.sentence for mistake in wiring.hidden}
    assert "robot 1: tau2 and tau3 are exchanged" in sentences
    assert "robot 2: tau2 and tau3 are exchanged" not in sentences


def test_without_rotation_nothing_is_claimed(trials: dict[str, Recording]) -> None:
    """A payload at rest: encoders flicker, and nothing says what belongs to what."""
    rng = np.random.default_rng(2)
    whole = trials["a"]
    still = {name: np.repeat(getattr(whole, name)[:1], 2000, axis=0) for name in ("phi", "theta", "tau")}
    still = {
        name: values + (TORQUE if name == "tau" else ENCODER) * rng.standard_normal(values.shape)
        for name, values in still.items()
    }
    time = np.arange(2000) / 100.0
    wiring = look(signals(dataclasses.replace(whole, time=time, ref=None, **still)))
    assert not wiring.as_is.determined
    assert wiring.found == ()
    # But a negative weight is one.
    (found,) = look(
        signals(dataclasses.replace(whole, time=time, ref=None, **still | {"tau": -still["tau"]}))
    ).found
    assert found.mistake.sentence == "all robots: tau has the wrong sign"


# Robots as a calibration has them


def misfit(recording: Recording, level: Level, arms: Arms) -> Misfit:
    found = signals_of(level, [samples(recording, level)], np.full((3, 9), 1e-9))
    return Team(found, arms).misfit


@pytest.mark.parametrize("level", ["joint", "wrist"])
def test_robots_as_they_are_fit_together(level: Level) -> None:
    carried, units = uncalibrated()
    as_they_are = misfit(carried.recording, level, units)
    as_designed = misfit(carried.recording, level, DESIGN)
    assert max(as_they_are.relative.values()) < 1e-3  # forces lack the gimbals' own moments, some mN m
    assert max(as_they_are.relative[name] for name in ("rotation", "velocity", "tilt")) < 1e-4
    assert max(as_designed.relative.values()) > 5e-3
