"""Robots that contradict each other beyond noise are told from robots that do not."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.leftover import (
    FINEST_NM,
    FINEST_RAD,
    UNKNOWN_NM,
    UNKNOWN_RAD,
    Leftover,
    beyond_noise,
    contradiction,
    left_over,
    steps_of,
)
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.signals import process_recording
from recorded_team import Sines, carry

BITS_16 = 2 * np.pi / 2**16


@cache
def exact():
    rng = np.random.default_rng(7)
    path = Sines.draw(rng, np.r_[np.full(3, 0.06), np.full(3, 0.02)], 3, 0.2, 0.8)
    return carry(path, Sines.draw(rng, np.full(3, 5.0), 3, 0.2, 0.8), 14.0).recording


def sensed(torque_noise=0.01, angle_step=BITS_16, torque_step=0.01, **zeros):
    """Through nominal sensors; robot 2's second joints read too much (its theta_z and base heading are one)."""
    rng, recording = np.random.default_rng(1), exact()
    channels = {}
    for name, step in (("phi", angle_step), ("theta", angle_step), ("tau", torque_step)):
        values = getattr(recording, name).copy()
        values[:, 1, 1] += zeros.get(name, 0.0)
        if name == "tau":
            values += torque_noise * rng.standard_normal(values.shape)
        channels[name] = np.round(values / step) * step if step else values
    return replace(recording, **channels)


def leftovers(recording, cutoff_hz=5.0):
    data = process_recording(recording, cutoff_hz)
    grasps, _ = estimate_grasps([data])
    return {one.name: one for one in left_over(data, grasps, steps_of(recording, cutoff_hz))}


def test_steps_are_those_of_the_channels():
    steps = steps_of(sensed(), 5.0)
    assert steps.phi_rad == pytest.approx(BITS_16, rel=1e-6)
    assert steps.theta_rad == pytest.approx(BITS_16, rel=1e-6)
    assert steps.tau_Nm == pytest.approx(0.01, rel=1e-6)


def test_channels_without_steps_are_not_taken_as_perfect():
    steps = steps_of(exact(), 5.0)
    assert (steps.phi_rad, steps.theta_rad, steps.tau_Nm) == (UNKNOWN_RAD, UNKNOWN_RAD, UNKNOWN_NM)
    fine = steps_of(sensed(0.0, FINEST_RAD / 8, FINEST_NM / 8), 5.0)
    assert (fine.phi_rad, fine.tau_Nm) == (FINEST_RAD, FINEST_NM)


@pytest.mark.parametrize("cutoff_hz", [3.0, 5.0, 8.0])
def test_noise_is_told_from_what_is_left_over(cutoff_hz):
    """White torque noise large against all else: power by the filter's closed form, and by its sixth differences."""
    found = leftovers(sensed(torque_noise=0.1), cutoff_hz)
    f = np.linspace(0.0, 5.0, 2000)  # in cut-offs
    power = 1.0 / (1.0 + f**6) ** 2
    expected = np.sqrt(np.sum(power) / np.sum(power * (2.0 - 2.0 * np.cos(np.pi * f)) ** 6 / 924.0))
    assert 1.0 < expected < 1.2
    for name in ("force", "moment"):
        assert found[name].ratio == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("error", [{}, {"torque_noise": 0.0}, {"angle_step": 0.0, "torque_step": 0.0}])
def test_robots_as_designed_do_not_contradict_each_other(error):
    estimate = estimate_payload([sensed(**error)], "joint")
    assert estimate.contradicts is False
    assert not estimate.flags


@pytest.mark.parametrize(
    ("zeros", "name"),
    [({"phi": 0.0175}, "flange_position"), ({"theta": 0.0175}, "flange_rotation"), ({"tau": 0.2}, "moment")],
)
def test_an_arm_off_its_design_contradicts_the_others(zeros, name):
    recording = sensed(**zeros)
    found = leftovers(recording)
    assert found[name].ratio > 5.0
    estimate = estimate_payload([recording], "joint")
    assert estimate.contradicts is True
    (flag,) = estimate.flags
    assert "contradict each other beyond noise" in flag
    assert "calibrate" in flag
    assert "mocobot diagnose" in flag
    assert "times the noise" in format_estimate(estimate)


def test_it_is_written_and_read():
    estimate = estimate_payload([sensed(phi=0.0175)], "joint")
    values = json.loads(json.dumps(estimate.to_dict(), allow_nan=False))
    assert values["contradicts"] is True
    again = PayloadEstimate.from_dict(values)
    assert again.contradicts is True
    assert again.recordings[0].leftovers == estimate.recordings[0].leftovers


def test_an_estimate_of_an_earlier_version_does_not_know():
    values = estimate_payload([sensed()], "joint").to_dict()
    del values["contradicts"], values["recordings"][0]["leftovers"]
    assert PayloadEstimate.from_dict(values).contradicts is None


@pytest.mark.parametrize("name", ["flange_position", "flange_rotation", "force", "moment"])
def test_three_times_the_noise_is_a_contradiction(name):
    """The threshold that the pages state, of each quantity."""
    noise, rest = 0.02, [Leftover("force", "N", 0.01, 0.01)]
    for times, wrong in ((2.9, False), (3.1, True)):
        one = Leftover(name, "", times * noise, noise)
        assert beyond_noise([*rest, one]) == ([one] if wrong else [])
        assert (contradiction([("first", [*rest, one])]) is not None) is wrong


def test_a_contradiction_names_the_worst_recording():
    def of(times):
        return [Leftover("flange_position", "m", times * 1e-3, 1e-3)]

    assert "(first)" in (contradiction([("first", of(4.0)), ("second", of(2.0))]) or "")
    said = contradiction([("first", of(4.0)), ("second", of(9.0)), ("third", of(2.0))]) or ""
    assert "(in 2 of 3 recordings, most in second)" in said
    assert "flanges miss their grasps by 9 mm rms (9 times noise)" in said
    assert "The robots contradict each other" in said
    alone = contradiction([("first", [Leftover("moment", "N m", 0.5, 0.1)])]) or ""
    assert "The robot contradicts itself" in alone
    assert "moments by 0.5 N m rms (5 times noise)" in alone
