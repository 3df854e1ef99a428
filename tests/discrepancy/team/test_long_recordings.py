"""Long recordings in parts: nothing is lost or counted twice, and the verdict is that of the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mocobot
from discrepancy.team import long
from discrepancy.team.candidates import in_shapes
from discrepancy.team.causes import CAUSES, read_tolerances
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.linear import start as filing
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import is_filed
from discrepancy.team.long import Choice, LaterPart, parted
from discrepancy.team.rig import TeamRig
from estimator.estimate.payload import estimate_payload
from patchwork import dense

FRICTION = {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}


@pytest.fixture(scope="module")
def recording():
    friction = mocobot.make_effect("joint_friction", FRICTION, robot=2, joint=1)
    return mocobot.simulate("b", "random", vias=20, seed=6, effects=[friction])


@pytest.fixture
def short_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long, "PART_S", 12.0)


def test_short_recordings_stay_whole(recording) -> None:
    assert parted([recording])[0] is recording
    choice = Choice.of([recording])
    assert choice.searched == [recording]
    assert choice.notes == choice.others == ()


@pytest.mark.usefixtures("short_parts")
def test_parts_have_all_rows_of_the_whole_once(recording) -> None:
    parts = parted([recording, recording])
    assert len(parts) == 6
    assert [isinstance(part, LaterPart) for part in parts] == [False, True, True] * 2
    assert isinstance(replace(parts[1], name="x"), LaterPart)
    assert len({part.name for part in parts[:3]}) == 3
    for part in parts[:3]:
        at = np.searchsorted(recording.time, part.time)
        np.testing.assert_array_equal(recording.time[at], part.time)  # the clock stays
        for name in ("phi", "theta", "tau", "ref"):
            np.testing.assert_array_equal(getattr(recording, name)[at], getattr(part, name))
    kept = np.concatenate([part.time[Signals.of(part).keep] for part in parts[:3]])
    np.testing.assert_array_equal(kept, recording.time[Signals.of(recording).keep])
    rows = sum(len(Reduction.of(Signals.of(part)).time) for part in parts[:3])
    assert abs(rows - len(Reduction.of(Signals.of(recording)).time)) <= 2


@pytest.mark.slow
def test_what_is_in_files_is_the_same(recording, monkeypatch: pytest.MonkeyPatch) -> None:
    """Linear trials and columns: as in memory."""
    known, causes = read_tolerances(None), ("joint_friction", "sea_bias", "grasp_play", "slosh")
    left_out = [name for name in CAUSES if name not in causes]
    estimate, made = estimate_payload([recording]), []
    for most in (filing.LINEAR_BYTES, 0.0):
        monkeypatch.setattr(filing, "LINEAR_BYTES", most)
        made.append(TeamRig.of([recording], estimate, known, left_out))
    whole, filed = made
    assert [is_filed(rig.linear[0]) for rig in made] == [False, True]
    for candidate in whole.candidates()[::5]:
        for one in (candidate, *in_shapes(candidate, CAUSES[candidate.cause].shapes, 1)[:1]):
            for _ in range(2):  # made, and kept
                np.testing.assert_array_equal(filed.columns(one)[0], whole.columns(one)[0])
            np.testing.assert_array_equal(dense(filed.unknowns(one)[0]), dense(whole.unknowns(one)[0]))
    some = [(c, 0.01 * c.units) for c in whole.candidates() if c.cause in ("sea_bias", "joint_friction")][:4]
    nothing = np.zeros(whole.linear[0].by_shared.shape[2]), [np.zeros(whole.local_unknowns)]
    exact = [rig.residual_there(*nothing, some)[0] for rig in made]
    np.testing.assert_array_equal(exact[1], exact[0])


@pytest.mark.slow
@pytest.mark.usefixtures("short_parts")
def test_verdict_of_parts(recording) -> None:
    """The simulator's own friction, within three standard errors; only the first part is simulated again."""
    found = diagnose_team([recording], laws="never").to_dict()
    (cause,) = found["causes"]
    assert found["verdict"] == "explained"
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("joint_friction", 2, 1)
    for name, truth in FRICTION.items():
        told = cause["parameters"][name]
        assert abs(told["value"] - truth) < 3.0 * told["se"] + 0.02 * truth
    assert len(found["recordings"]) == 3
    assert len(found["gain"]["trials"]) == 1
    assert any("in 3 parts" in note for note in found["notes"])
