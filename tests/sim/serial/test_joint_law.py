"""Formulas at a joint of a simulated robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.errors import InputError
from mocobot_sim.serial.effects import ActingLaw, JointLaw, State

STATE = State(
    3.0, 1e-3, np.array([0.1, 0.2]), np.array([0.0, -0.5]), np.zeros(2), np.zeros(2), np.array([4.0, 0.0])
)


def test_laws_of_other_signals() -> None:
    """Cross-talk, and friction that goes with the place, by hand."""
    crossed = JointLaw("torque_2", "linear", "torque_1", 0.05)
    assert ActingLaw(crossed).torque(STATE) == pytest.approx(0.2)
    tight = JointLaw("torque_2", "sine", "q_2", 0.3, 2.0, 0.0, 0.1, "direction_2")
    assert ActingLaw(tight).torque(STATE) == pytest.approx(-0.3 * np.sin(0.5), rel=1e-6)


def test_a_law_remembers_within_a_run() -> None:
    """A play of 0.05 rad half width: pushed against one side, it stays behind by its half width."""
    acting = ActingLaw(JointLaw("torque_1", "play", "q_1", 2.0, 0.05))
    out = [acting.torque(replace(STATE, q=np.array([x, 0.0]))) for x in (0.0, 0.03, 0.2, 0.19)]
    assert out == pytest.approx([0.0, -1.2, -2.0, -1.6])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"target": "elbow"}, "target is 'elbow'"),
        ({"function": "power"}, "function is 'power'"),
        ({"of": "phi_2_1"}, "of is 'phi_2_1'"),
        ({"times": "q"}, "times is 'q'"),
        ({"function": "lag", "number": 0.0}, "number is 0.0"),
    ],
)
def test_laws_that_are_none(values: dict[str, object], message: str) -> None:
    good = JointLaw("torque_1", "linear", "q_1", 1.0).to_dict()
    assert JointLaw.of_dict(good, "effects.json").of == "q_1"
    with pytest.raises(InputError, match=message):
        JointLaw.of_dict(good | values, "effects.json")
