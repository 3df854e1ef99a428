"""Of long recordings some parts are searched: which, and how the others show that something else is in them."""

from __future__ import annotations

import numpy as np
import pytest

import mocobot
from discrepancy.team import long
from discrepancy.team.causes import read_tolerances
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.long import Choice, Left, more_left
from discrepancy.team.rig import AsFound, TeamRig
from estimator.arm.unit import COUNT, ArmUnit
from estimator.estimate.payload import estimate_payload

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
        (long, "WHOLE_S", 26.0), (long, "SEARCHED_S", 26.0), (long, "SHORTEST_PART_S", 13.0),
        (long, "ODD_WINDOW_S", 2.0),
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


def drawn(rng: np.random.Generator, windows: int = 12, holds: int = 0) -> Left:
    """Windows of a hundred normal rows of six channels."""
    rows = rng.standard_normal((windows, 100, 6)) * [1.0, 1e-3, 10.0, 1.0, 1.0, 1.0]
    return Left(rows.mean(axis=1), rows.std(axis=1), rng.standard_normal((holds, 6)))


@pytest.mark.parametrize("what", ["push", "noise", "hold"])
def test_something_else_is_seen(what: str) -> None:
    """In one window of one part: a mean of 1.2 standard deviations of a row, a noise three times as loud, a hold."""
    rng = np.random.default_rng(4)
    others, searched = {k: drawn(rng, holds=3) for k in range(20)}, [drawn(rng, holds=12) for _ in range(4)]
    assert max(more_left(others, searched).values()) < 1.0
    left = others[7]
    if what == "push":
        left.means[3, 1] += 1.2e-3
    elif what == "noise":
        left.rms[3, 2] *= 3.0
    else:
        left.holds[1, 4] += 12.0
    more = more_left(others, searched)
    assert [k for k, by in more.items() if by > 1.0] == [7]


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
@pytest.mark.parametrize(
    ("cause", "parameters", "place"),
    [("drag", {"coefficient_Ns_per_m": 8.0}, (None, None)), ("joint_friction", FRICTION, (2, 1))],
)
def test_what_was_found_is_out_of_what_another_part_leaves(cause, parameters, place) -> None:
    """A cause at the simulator's own size: with it about as little is left as where it is not; without it far more.

    Friction while a joint rests is left open, and remains.
    """
    robot, joint = place
    where = {} if robot is None else {"robot": robot, "joint": joint}
    effect = mocobot.make_effect(cause, parameters, **where)
    clean, other = (mocobot.simulate("b", "random", vias=14, seed=7, effects=e) for e in ([], [effect]))
    rig = TeamRig.of([clean], estimate_payload([clean]), read_tolerances(None))
    (candidate,) = (c for c in rig.candidates() if c.key == (cause, robot, joint))
    values = np.array([parameters.get(p.name, 0.0) for p in candidate.parameters])
    units = ArmUnit(rig.linear[0].design, np.zeros((3, COUNT)))
    there = units, rig.linear[0].shared
    healthy = rms_of(rig.left_in(clean, AsFound(*there, [])))
    with_it = rms_of(rig.left_in(other, AsFound(*there, [(candidate, values)])))
    without = rms_of(rig.left_in(other, AsFound(*there, [])))
    assert np.all(with_it < 1.5 * healthy)
    assert np.any(without > 5.0 * healthy)


def rms_of(left) -> np.ndarray:
    """Of every channel in motion, shape (C,)."""
    reduction, rows = left
    return np.sqrt(np.mean(rows[: reduction.moving] ** 2, axis=0))


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
