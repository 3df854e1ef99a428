"""Encoders that start again after each turn."""

import numpy as np

from mocobot_logs.joints.read import unwrapped


def test_positions_within_one_turn_are_unwrapped() -> None:
    time = np.linspace(0.0, 10.0, 2001)
    true = np.column_stack([4.0 * np.sin(time), 0.5 * np.sin(time)])
    told = (true + np.pi) % (2.0 * np.pi) - np.pi
    told[7, 0] = np.nan
    out, notes = unwrapped(told, ["q of elbow", "q of wrist"])
    known = np.isfinite(told)
    assert np.allclose(out[known], true[known])
    assert len(notes) == 1
    assert notes[0].startswith("q of elbow is told within one turn; ")


def test_positions_of_motors_that_turn_fast_stay_as_they_are() -> None:
    fast = np.cumsum(np.full(100, 5.0))[:, None]
    out, notes = unwrapped(fast, ["motor_position of wheel"])
    assert out is fast
    assert not notes
