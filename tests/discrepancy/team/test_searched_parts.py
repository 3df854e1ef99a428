"""Of long recordings some parts are searched: which, and how the others show that something else is in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mocobot
from discrepancy.result.read import WrittenDiagnosis
from discrepancy.team import long
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.long import Choice, Left, more_left, times_as_much

FRICTION = {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}
PUSH = {
    "trial": 1, "start_s": 41.0, "duration_s": 4.0, "force_x_N": 0.0, "force_y_N": 2.0, "force_z_N": 0.0,
    "point_x_m": 0.3, "point_y_m": 0.2, "point_z_m": 0.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def recording():
    effects = [
        mocobot.make_effect("joint_friction", FRICTION, robot=2, joint=1),
        mocobot.make_effect("push", PUSH),
    ]
    return mocobot.simulate("b", "random", vias=44, seed=6, effects=effects)


@pytest.fixture
def little_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    for owner, name, value in (
        (long, "SEARCHED_S", 26.0), (long, "SHORTEST_PART_S", 13.0), (long, "ODD_WINDOW_S", 2.0),
    ):  # fmt: skip
        monkeypatch.setattr(owner, name, value)


@pytest.mark.usefixtures("little_is_searched")
def test_parts_are_spread_evenly(recording) -> None:
    choice = Choice.of([recording])
    assert len(choice.parts) == 5
    assert choice.taken == (0, 2)
    assert choice.others == (1, 3, 4)
    assert [part.name for part in choice.searched] == [choice.parts[k].name for k in (0, 2)]
    assert choice.beside([3]).taken == (0, 2, 3)
    (note,) = choice.notes
    assert note.startswith("2 parts, 0.5 of 1.1 minutes, were searched")
    whole = Choice.of([recording], whole=True)
    assert whole.others == whole.notes == ()
    assert len(whole.parts) == 1  # as long as the rules allow of one part


@pytest.mark.usefixtures("little_is_searched")
def test_a_diagnosis_of_parts_is_of_their_recording(recording) -> None:
    """As replay asks it, for one; not of another whose name begins alike."""
    parts = Choice.of([replace(recording, name="logs/a, b.parquet")]).searched
    written = WrittenDiagnosis("consistent", (), tuple(part.name for part in parts))
    assert written.is_of("elsewhere/a, b.parquet")
    assert not written.is_of("a")
    assert not written.is_of("a, b.parquet2")
    assert WrittenDiagnosis("consistent", (), ("logs/rec.parquet",)).is_of("rec.parquet")


def test_windows(recording) -> None:
    """Means and what is about them, of every ten seconds of motion or a little more."""
    reduction = Reduction.of(Signals.of(recording))
    time = reduction.time[: reduction.moving]
    rows = np.zeros((len(reduction.time), 2))
    length_s = (time[-1] - time[0]) / 5  # five windows of ten seconds would leave some over
    assert 10.5 < length_s < 12.0
    rows[: reduction.moving, 0] = np.where(time < time[0] + length_s + 1e-6, 3.0, -1.0)
    rows[: reduction.moving, 1] = np.where(np.arange(len(time)) % 2, 0.5, -0.5)
    left = Left.of(reduction, rows)
    np.testing.assert_allclose(left.means[:, 0], [3.0] + [-1.0] * 4)
    np.testing.assert_allclose(left.rms[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(left.rms[:, 1], 0.5, rtol=1e-4)
    np.testing.assert_allclose(left.means[:, 1], 0.0, atol=0.01)
    assert len(left.holds) == len(reduction.time) - reduction.moving
    assert times_as_much(
        [replace(left, means=3.0 * left.means, rms=3.0 * left.rms)], [left]
    ) == pytest.approx(3.0)
    still = replace(left, means=left.means[:0], rms=left.rms[:0])
    assert times_as_much([left], [still]) is times_as_much([still], [left]) is None


def test_chance_is_as_stated() -> None:
    """Without the factor: of 600 long recordings with normal windows, means call for a part in one of a hundred."""
    rng = np.random.default_rng(6)
    called, none = 0, np.ones((0, 6))
    for _ in range(600):
        parts = [
            Left(means, none, none)
            for means in rng.standard_normal((24, 12, 6)) * [1.0, 1e-3, 10.0, 1.0, 1.0, 1.0]
        ]
        called += max(more_left(dict(enumerate(parts[4:])), parts[:4]).values()) > 1.0 / long.ODD_FACTOR
    assert 0 < called < 14  # 6 are expected; 14 or more have a chance of 0.3 %


@pytest.mark.slow
@pytest.mark.usefixtures("little_is_searched")
def test_what_is_in_another_part_is_found(recording) -> None:
    """A push where nobody searched at first: its part is searched, too, and both are named at their size."""
    found = diagnose_team([recording], laws="never", closed_loop=False)
    told = found.to_dict()
    assert {cause["cause"] for cause in told["causes"]} == {"joint_friction", "push"}
    friction, push = sorted(told["causes"], key=lambda cause: cause["cause"])
    assert (friction["robot"], friction["joint"]) == (2, 1)
    coulomb, viscous = (friction["parameters"][name] for name in FRICTION)
    assert coulomb["value"] == pytest.approx(FRICTION["coulomb_Nm"], rel=0.06)
    # Three parts of 13 s tell it to 9 %, the error of its law included.
    assert viscous["se"] < 0.1 * FRICTION["viscous_Nms_per_rad"]
    assert viscous["value"] == pytest.approx(FRICTION["viscous_Nms_per_rad"], abs=2.0 * viscous["se"])
    assert push["parameters"]["force_y_N"]["value"] == pytest.approx(2.0, rel=0.1)
    assert push["parameters"]["start_s"]["value"] == pytest.approx(41.0, abs=0.03)
    assert len(told["recordings"]) == 3
    assert any("was held against the other 2 parts" in note for note in told["notes"])
    assert any(note.startswith("In none of the parts that were not searched") for note in told["notes"])
    assert any("times as much as in those that were" in note for note in told["notes"])
