"""Effects that the axis' catalogue does not list, hidden in a simulated axis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.emps.diagnosis import diagnose_emps
from discrepancy.emps.laws.bench import FORCE
from discrepancy.laws.candidate import LawCandidate
from emps_made import nominal, recorded, reference
from mocobot_sim.emps.extended import load_plant
from mocobot_sim.emps.law import AxisLaw
from mocobot_sim.emps.loop import Start, run

SPOT_N, KNEE_M = 400.0, 0.06


def test_forces_and_voltages_by_formula_are_those_of_listed_effects() -> None:
    """A constant force is a force offset, and 40 V/m of the error is so much more gain."""
    time, q = np.arange(1500) / 1000.0, reference()[:1500]
    start = Start(float(q[0]), 0.0, np.zeros(4), np.zeros(4))
    plant = replace(nominal(), coulomb_N=(20.0, 20.0), viscous_Ns_per_m=(200.0, 200.0))
    law = AxisLaw("force", "constant", "time", 5.0)
    both = [replace(plant, resisting_N=5.0), replace(plant, laws=(law,))]
    one, other = (run(p, time, q, start) for p in both)
    assert np.abs(one[0] - other[0]).max() < 1e-9
    gained = replace(plant, kp_per_s=plant.kp_per_s + 40.0 / plant.kv_Vs_per_m)
    one, other = (
        run(p, time, q, start)
        for p in (gained, replace(plant, laws=(AxisLaw("voltage", "linear", "error", 40.0),)))
    )
    assert np.abs(one[0] - other[0]).max() < 1e-9


@pytest.mark.slow
def test_a_way_that_rubs_more_at_its_end(tmp_path: Path) -> None:
    """Dry friction that grows from 60 mm on."""
    tight = AxisLaw("force", "above", "position", SPOT_N, KNEE_M, times="direction")
    plant = replace(nominal(), coulomb_N=(20.0, 20.0), viscous_Ns_per_m=(200.0, 200.0), laws=(tight,))
    found = diagnose_emps(recorded(plant, seed=3, name="tight.mat"))
    law = next(f for f in found.diagnosis.causes if isinstance(f.candidate, LawCandidate))
    assert law.candidate.at.name == FORCE
    assert law.candidate.term.variables == ("position", "direction")
    x = np.linspace(0.0, float(np.max(reference())), 50)
    term = law.candidate.term
    values = (
        term.law.of(x, 1000.0, term.numbers) @ law.values[: term.law.of(x, 1000.0, term.numbers).shape[1]]
    )
    truth = SPOT_N * np.maximum(x - KNEE_M, 0.0)
    off = (values - values.mean()) - (truth - truth.mean())  # a constant is Coulomb friction
    assert np.std(off) < 0.15 * np.std(truth)
    gain = found.diagnosis.gain
    assert gain is not None
    assert gain.removed()[0] > 0.8
    found.write_into(tmp_path)
    assert load_plant(tmp_path / "extended").laws
