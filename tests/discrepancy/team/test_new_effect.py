"""A new effect is two files and one line each: hidden, it is named, simulated, written and marked in the replay."""

from pathlib import Path

import numpy as np
import pytest

from discrepancy.result.read import read_diagnosis
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnosis import diagnose_team
from hidden_team import recorded
from joint_spring_cause import JointSpring as Trace
from joint_spring_effect import JointSpring
from mocobot_sim.effects import EFFECTS, make_effect
from mocobot_sim.extended.extended import load_extended
from mocobot_view.robot import body_of

STIFFNESS = 0.3


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line each."""
    monkeypatch.setitem(EFFECTS, "joint_spring", JointSpring)
    monkeypatch.setitem(CAUSES, "joint_spring", Trace())


@pytest.mark.slow
@pytest.mark.usefixtures("registered")
def test_two_files_are_all_that_an_effect_needs(tmp_path: Path) -> None:
    hidden = make_effect("joint_spring", {"stiffness_Nm_per_rad": STIFFNESS}, robot=3, joint=2)
    found = diagnose_team(recorded("a", [hidden], seed=11, vias=6))
    values = found.to_dict()

    # Named: the right cause at the right place, its size and sentence.
    (cause,) = values["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("joint_spring", 3, 2)
    stiffness = cause["parameters"]["stiffness_Nm_per_rad"]
    assert stiffness["value"] == pytest.approx(STIFFNESS, abs=max(4.0 * stiffness["se"], 0.03 * STIFFNESS))
    assert cause["sentence"].startswith("Robot 3, joint 2: a hose pulls the driven joint back with 0.3")
    assert str(found).startswith("EXPLAINED: one finding accounts for")
    assert cause["sentence"] in " ".join(found.verbose_text().split())

    # Simulated: with it the response to the commands is nearly that of the recordings.
    before, after = (values["gain"]["held_out"][name]["chi2_per_n"] for name in ("before", "after"))
    assert after < 0.2 * before

    # Written, and read again: whoever takes the model away has the hose in it.
    found.write_into(tmp_path)
    scene = load_extended(tmp_path / "extended")
    (effect,) = scene.effects
    assert (effect.robot, effect.joint) == (3, 2)
    assert effect.stiffness_Nm_per_rad == pytest.approx(stiffness["value"], rel=1e-3)
    model = scene.compile()
    assert np.ravel(model.tendon_stiffness[model.tendon("hose3_2").id])[0] == effect.stiffness_Nm_per_rad

    # Replayed: marked at the link that it pulls.
    (mark,) = read_diagnosis(tmp_path).causes
    assert (mark.name, mark.robot, body_of(mark)) == ("joint_spring", 3, "proximal2")
    assert mark.sentence == cause["sentence"]
