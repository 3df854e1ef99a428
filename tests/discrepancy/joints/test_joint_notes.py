"""What a diagnosis says of its logs, once."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy.joints.trials import notes_of, resting


def log(name: str, *notes: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, notes=notes)


def test_notes_that_differ_in_numbers_are_told_once():
    logs = [
        log("monday", "Stamps are uneven (0.0052 to 0.006 s apart).", "3 rows repeat."),
        log("tuesday", "Stamps are uneven (5.1e-03 to 0.00607 s apart)."),
        log("friday"),
        log("sunday", "Stamps are uneven (0.003 to 0.004 s apart)."),
    ]
    assert list(notes_of(logs)) == [
        "monday: Stamps are uneven (0.0052 to 0.006 s apart). "
        "So it is, with other numbers, in 2 more parts of the logs.",
        "monday: 3 rows repeat.",
    ]


@pytest.mark.parametrize("rate_hz", [50.0, 500.0])
def test_joints_that_rest_are_told(rate_hz: float) -> None:
    rng, time = np.random.default_rng(0), np.arange(round(10.0 * rate_hz)) / rate_hz

    def log(*sizes: float, noise: float = 1e-4, step: float = 0.0) -> SimpleNamespace:
        q = np.column_stack([size * np.sin(3.0 * time) for size in sizes])
        q += noise * rng.standard_normal(q.shape)
        return SimpleNamespace(
            joints=("turret", "shoulder", "elbow"),
            q=np.round(q / step) * step if step else q,
            position_step=np.full(3, step),
        )

    assert list(resting([log(0.5, 0.2, 0.01)])) == []
    (said,) = resting([log(0.5, 0.0, 0.2)])
    assert said == "shoulder does not move in these logs, which tell no friction and no rotor there."
    assert list(resting([log(0.5, 0.0, 0.2), log(0.5, 0.1, 0.2)])) == []
    (said,) = resting([log(0.5, 0.0, 0.0, noise=1e-5, step=1e-3)])
    assert said.startswith("shoulder and elbow do not move")
    (said,) = resting([log(0.0, 0.0, 0.0)])
    assert said.startswith("No joint moves in these logs; ")
    assert list(resting([])) == []
