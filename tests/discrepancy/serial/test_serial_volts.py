"""What a servo's volts are: rows for duties, and what a volt may be worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.forms import forms_beside
from discrepancy.serial.rig import SerialRig

from discrepancy.joints.model import SerialModel
from discrepancy.joints.servo.motor import with_torques
from discrepancy.rules import serial as rules
from mocobot_logs.joints.joint_log import JointLog
from test_serial_servo import logs, model  # noqa: F401 (fixtures)


def test_rows_of_duties_are_slower(model: SerialModel, logs: list[JointLog]) -> None:  # noqa: F811
    by_duty = SerialRig.of(model, logs[:2]).parts[0]
    told, _ = with_torques(model, logs[:2])
    by_torque = SerialRig.of(
        model, [replace(log, drive=replace(log.drive, duty=None)) for log in told]
    ).parts[0]
    assert by_duty.signals.cutoff_hz == rules.SERVO_CUTOFF_HZ
    assert by_torque.signals.cutoff_hz == rules.CUTOFF_HZ
    rows = [len(part.reduction.samples[0]) for part in (by_duty, by_torque)]
    assert rows[0] < 0.6 * rows[1]


def test_a_volt_may_be_worth_another_torque_elsewhere(model: SerialModel, logs: list[JointLog]) -> None:  # noqa: F811
    rig = SerialRig.of(model, logs[:2])
    (spring,) = (c for c in rig.candidates() if c.cause == "spring")
    beside = forms_beside(rig, spring, np.array([0.1]), [])
    # A torque that falls by a twentieth of itself where the joint is far out is one of these forms.
    part, k = rig.block_of[0]
    torque = part.signals.torque
    far = np.abs(part.signals.q) / np.abs(part.signals.q).max()
    trace = rig.whitening[0](part.reduction(0.05 * torque * far**2)[k][:, rig.joints]).ravel()
    basis = beside[0].reshape(-1, beside[0].shape[2])
    left = trace - basis @ np.linalg.lstsq(basis, trace, rcond=None)[0]
    assert np.sum(left**2) < 0.05 * np.sum(trace**2)
    # So is one that is a twentieth more in all of one log, with a warmer winding, and not in the other.
    assert len(rig.parts) == 2
    more = [
        0.05 * (own is rig.parts[1]) * own.reduction(own.signals.torque)[k][:, rig.joints]
        for own, k in rig.block_of
    ]
    trace = np.concatenate([rig.whitening[t](x).ravel() for t, x in enumerate(more)])
    basis = np.concatenate([x.reshape(-1, x.shape[2]) for x in beside])
    left = trace - basis @ np.linalg.lstsq(basis, trace, rcond=None)[0]
    assert np.sum(left**2) < 1e-9 * np.sum(trace**2)
    (friction,) = (c for c in rig.candidates() if c.cause == "load_friction")
    assert not forms_beside(rig, friction, np.array([0.1]), [])


def test_noise_is_no_load(model: SerialModel, logs: list[JointLog]) -> None:  # noqa: F811
    """Without a load friction by load is none, however loud the accelerations are beyond what the rows keep."""
    s = SerialRig.of(model, logs[:2]).parts[0].signals
    noise = np.random.default_rng(1).standard_normal(s.q.shape)
    moving = replace(s, dq=np.full(s.q.shape, 2.0 * s.slow), ddq=np.zeros(s.q.shape), inverse=noise)
    trace = CAUSES["load_friction"].columns(moving, 0, {"load_Nm": 0.0})
    # Half-normal, of as much of the white noise as passes two passes of third order: the integral of 1 / (1 + x^6)^2 is
    # (5/6) (pi/6) / sin(pi/6) = 0.873.
    passes = np.sqrt(0.873 * s.cutoff_hz / (s.rate_hz / 2.0))
    assert trace.mean() == pytest.approx(passes * np.sqrt(2.0 / np.pi), rel=0.1)
