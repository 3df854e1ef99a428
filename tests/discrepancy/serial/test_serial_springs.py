"""Springs that MuJoCo has at a joint, neutral anywhere in its travel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discrepancy.serial.diagnosis import diagnose_serial
from serial_made import a_little_off, nominal, simulated, spec


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "stiffness"), [(3, 3.0), (4, 0.8)])
def test_a_spring_is_found_with_its_neutral(tmp_path: Path, joint: int, stiffness: float) -> None:
    """Of a joint whose masses take up most of it, too: no offset, ripple or balancer besides or instead."""
    changed = a_little_off(spec(), np.random.default_rng(120 + joint))
    neutral = 0.55
    changed.joints[joint - 1].stiffness = [stiffness, 0.0, 0.0]
    changed.joints[joint - 1].springref = neutral
    log = simulated(changed.compile(), 13)
    found = diagnose_serial(nominal(tmp_path), [log], laws="never", closed_loop=False)
    ((spring,)) = found.diagnosis.causes
    assert (spring.candidate.cause, spring.candidate.joint) == ("spring", joint)
    assert spring.values[0] == pytest.approx(stiffness, abs=3.0 * float(np.sqrt(spring.covariance[0, 0])))
    error = float(np.sqrt(spring.covariance[1, 1]))
    assert spring.candidate.shape["neutral"] == pytest.approx(neutral, abs=3.0 * error)
    assert error < 0.3
