"""From which size on the arm's campaign says that an effect can be found, held against what tolerances allow."""

import numpy as np
import pytest

from discrepancy.joints.problem import TILT_RAD
from joints import arm as machine
from joints.arm import CAUSE_OF, TYPICAL, Form
from joints.sets import ArmSet, Shown, read


@pytest.mark.slow
def test_a_tilt_shows_no_more_than_its_tolerance_costs(tmp_path, monkeypatch):
    """A base that is off leaves at most its square in tolerances, whatever else the arm has that is off."""
    monkeypatch.setattr(machine, "SECONDS", 20.0)
    rng = ArmSet.of(14133).rng
    arm = machine.healthy(rng("arm"))
    motion = machine.moved(arm.spec, rng("motion"))
    log = machine.logged("clean", motion.time, *read(arm, (), motion), rng("noise"))
    shown = Shown.of(rng, machine.nominal(tmp_path), log)
    tilt = Form("tilt", CAUSE_OF["tilt"], None, TYPICAL["tilt"], 14133)
    tolerances = tilt.size / TILT_RAD
    gain = shown.by(tilt)
    assert 0.8 * tolerances**2 < gain < 1.01 * tolerances**2
    assert shown.limit(tilt) > np.sqrt(2.0 * shown.search.against) * TILT_RAD
