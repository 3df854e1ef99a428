"""A law that no table lists is told by its formula, and the extended model has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from diagnosed import check_finite
from discrepancy.result import folder
from discrepancy.team.diagnosis import diagnose_team
from hidden_team import recorded
from mocobot_sim.effects.law import Law
from mocobot_sim.extended.extended import load_extended

TRUE = Law("tau_2_1", "sine", "phi_2_1", amplitude=0.05, number=12.0, phase_rad=0.7)


@pytest.mark.slow
def test_an_unlisted_law_is_told_and_carried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A torque sensor that feels where its joint stands."""
    monkeypatch.setattr(folder, "draw", lambda *given, **more: None)
    found = diagnose_team(recorded("b", [TRUE], seed=2), closed_loop=False)
    values = found.to_dict()
    check_finite(values)
    (cause,) = values["causes"]
    law = cause["law"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("unlisted", 2, 1)
    assert (law["place"], law["targets"], law["of"]) == ("tau reading", ["tau_2_1"], "phi_2_1")
    assert (law["function"], law["numbers"]) == ("sine", {"times": 12.0})
    for name, true in (("amplitude", TRUE.amplitude), ("phase_rad", TRUE.phase_rad)):
        size = cause["parameters"][name]
        assert size["value"] == pytest.approx(true, abs=4.0 * size["se"] + 0.03 * true)
    assert law["units"] == {"amplitude": "N m", "phase_rad": "rad", "times": ""}
    assert "mN m sin(12 phi_21 + 0." in cause["sentence"]
    assert "mN m sin(12 phi_21 + 0." in str(found).partition("probability")[2]  # its row in the table
    assert len(law["traces"]) == len(values["recordings"])
    found.write_into(tmp_path)
    sine, constant = load_extended(tmp_path / "extended").effects
    assert isinstance(sine, Law)
    assert (sine.target, sine.function, sine.of, sine.number) == ("tau_2_1", "sine", "phi_2_1", 12.0)
    assert sine.amplitude == pytest.approx(TRUE.amplitude, rel=0.1)
    assert isinstance(constant, Law)
    assert (
        constant.function == "constant"
    )  # a bias is a cause of its own: the law has the mean that it was found with
