"""What a verdict makes of the logs as they come: broken off, held against a reference, with gaps, of any rate."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from discrepancy.evidence.search import Chosen, Search, floor_of
from discrepancy.joints.diagnose import Outcome, Until, labels_of
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import Given, joint_problem
from discrepancy.joints.trials import trials_of
from discrepancy.joints.verdict import JointVerdict, judged
from estimator.errors import InputError
from followed_arm import RATE_HZ, TORQUE_NOISE_NM, Change, arm_log, arm_model, both, rubs
from mocobot_logs.joints.joint_log import JointLog

NAMED = rubs(0.5, 0.3)
"""Friction that the model names, and the robot has."""
ELBOW = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return arm_model(tmp_path_factory.mktemp("arm"), NAMED)


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    """A model without friction."""
    return arm_model(tmp_path_factory.mktemp("bare"))


@pytest.fixture(scope="module")
def log() -> JointLog:
    return arm_log(NAMED, 21)


def what(verdict: JointVerdict) -> set[tuple[str, str]]:
    return {(f.cause, f.place) for f in verdict.findings}


def part(log: JointLog, every: int = 1, most: int | None = None) -> JointLog:
    """Some samples of a log."""
    own = {name: getattr(log, name)[:most:every] for name in ("time", "q", "torque", "usable")}
    return replace(log, rate_hz=log.rate_hz / every, native_hz=log.rate_hz / every, **own)


# --- any time


@pytest.mark.parametrize("at", ["first", "later"])
def test_what_is_broken_off_has_the_best_so_far(
    bare: SerialModel, log: JointLog, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    """By the user, before anything is found and after the first cause."""
    grown = Search._grown
    calls = []

    def interrupted(search: Search, *given: object, **more: bool) -> object:
        calls.append(search)
        if len(calls) > (0 if at == "first" else 1):
            raise KeyboardInterrupt
        return grown(search, *given, **more)

    monkeypatch.setattr(Search, "_grown", interrupted)
    verdict = judged(bare, [log])
    assert not verdict.finished
    assert what(verdict) == (set() if at == "first" else {("friction", "all joints")})


def test_a_search_ends_after_some_seconds(bare: SerialModel, log: JointLog) -> None:
    verdict = judged(bare, [log], seconds=0.0)
    assert not verdict.finished
    assert what(verdict) == set()
    assert judged(bare, [log]).finished


def test_time_is_up_for_good() -> None:
    until = Until(end_s=0.0)
    assert until()
    assert until.broken
    assert not Until()()


# --- a reference


def heavier(spec: mujoco.MjSpec) -> None:
    """What the model gets wrong on both days: a link, a zero and a rotor."""
    spec.body("two").mass *= 1.8
    spec.joint("elbow").armature = 0.1


def loaded(spec: mujoco.MjSpec) -> None:
    box = spec.body("three").add_body()
    box.mass, box.explicitinertial, box.pos = 1.0, True, [0.25, 0.0, 0.0]
    box.ipos, box.inertia = [0.0, 0.0, 0.0], [4e-4, 5e-4, 6e-4]


NEWS: dict[str, tuple[Change, tuple[str, str] | None, dict[str, float]]] = {
    "nothing": (lambda spec: None, None, {}),
    "friction": (rubs(0.9, 0.3, "elbow"), ("friction", "elbow"), {"coulomb_Nm": 0.4}),
    "payload": (loaded, ("payload", "three"), {"mass_kg": 1.0, "x_m": 0.25}),
}


@pytest.mark.parametrize("case", NEWS)
def test_what_has_changed_since_the_reference(bare: SerialModel, case: str) -> None:
    """The model lacks all friction, and has two numbers wrong: these are no news."""
    change, expected, true = NEWS[case]
    before, after = arm_log(both(NAMED, heavier), 22), arm_log(both(NAMED, heavier, change), 23)
    verdict = judged(bare, [after], reference=[before])
    assert len(verdict.reference) == 1
    if expected is None:
        assert not verdict.findings
        assert verdict.verdict == "consistent"
        return
    assert what(verdict) == {expected}
    (member,) = verdict.findings[0].members
    for name, x in true.items():
        assert abs(member.values[name] - x) < 4.0 * member.errors[name]


# --- logs as they come


def test_a_single_log_is_three_parts_that_predict_each_other(bare: SerialModel, log: JointLog) -> None:
    verdict = judged(bare, [log])
    assert verdict.validated
    assert len(verdict.trials) == 3
    assert all(name.startswith("log 21 ") for name in verdict.trials)
    lengths = [len(s.time) for s in verdict.parts]
    assert max(lengths) - min(lengths) <= 1
    for one in verdict.predictions:
        assert np.all(one.after < 0.15 * one.before)


def test_a_short_log_is_one_part(model: SerialModel, log: JointLog) -> None:
    trials = trials_of(model, [part(log, most=round(6.0 * RATE_HZ))])
    assert trials.names == ("log 21",)
    assert not judged(model, [part(log, most=round(6.0 * RATE_HZ))]).validated


@pytest.mark.parametrize("kind", ["torque", "usable"])
def test_logs_are_cut_at_gaps(model: SerialModel, log: JointLog, kind: str) -> None:
    """One of a second; a short one is bridged, and what lies between gaps that are too near is left out."""
    torque, usable = log.torque.copy(), log.usable.copy()
    for begin, end in ((8.0, 9.0), (9.5, 10.0), (15.0, 15.012)):
        gap = (log.time >= begin) & (log.time < end)
        if kind == "torque":
            torque[gap, 1] = np.nan
        else:
            usable[gap] = False
    trials = trials_of(model, [replace(log, torque=torque, usable=usable)])
    ends = [(float(run.time[0]), float(run.time[-1])) for run in trials.runs]
    assert ends == [pytest.approx((0.1, 7.9), abs=0.02), pytest.approx((10.1, 23.9), abs=0.02)]
    assert len(trials.names) == 2
    verdict = judged(model, [replace(log, torque=torque + 0.4 * ELBOW, usable=usable)])
    assert what(verdict) == {("torque_offset", "elbow")}


def test_a_joint_without_torques_is_left_out(bare: SerialModel, log: JointLog) -> None:
    torque = log.torque.copy()
    torque[:, 1] = np.nan
    silent = replace(log, torque=torque)
    assert trials_of(bare, [silent]).joints.tolist() == [0, 2]
    verdict = judged(bare, [silent])
    assert what(verdict) == {("friction", "all joints")}
    assert [m.place for m in verdict.findings[0].members] == ["turn", "elbow"]
    for member in verdict.findings[0].members:
        assert member.values["coulomb_Nm"] == pytest.approx(0.5, abs=4.0 * member.errors["coulomb_Nm"])
    assert all(np.isfinite(one.after).all() for one in verdict.predictions)


def test_logs_that_cannot_be_used(model: SerialModel, log: JointLog) -> None:
    with pytest.raises(InputError, match="no torques"):
        judged(model, [replace(log, torque=None)])
    with pytest.raises(InputError, match="no joint has torques in every log"):
        judged(model, [replace(log, torque=np.full(log.q.shape, np.nan))])
    with pytest.raises(InputError, match=r"at least 2\.2 s without gaps"):
        judged(model, [replace(log, usable=np.zeros(len(log.time), dtype=bool))])


@pytest.mark.parametrize("every", [1, 5])
def test_rates_do_not_change_the_verdict(bare: SerialModel, every: int) -> None:
    """250 and 50 Hz."""
    true = both(NAMED, loaded)
    friction, load = judged(bare, [part(arm_log(true, 24), every)]).findings
    assert friction.told == (("friction", "all joints"),)
    assert ("payload", "three") in load.told


# --- noise


def test_noise_is_that_of_the_sensors(model: SerialModel) -> None:
    """A torque whose noise is large beside what rounded positions make of accelerations."""
    rng = np.random.default_rng(1)
    log = arm_log(NAMED, 21)
    loud = replace(log, torque=log.torque + 0.3 * rng.standard_normal(log.torque.shape))
    trials = trials_of(model, [loud])
    (noise,), (run,) = trials.noise, trials.runs
    mean = round(0.1 * run.rate_hz)
    slow = noise[: len(noise) // mean * mean].reshape(-1, mean, 3).mean(axis=1).std(axis=0)
    true = np.hypot(0.3, TORQUE_NOISE_NM) / np.sqrt(0.1 * RATE_HZ)  # of the mean of so many white readings
    np.testing.assert_allclose(slow, true, rtol=0.25)


def test_louder_sensors_are_heard(model: SerialModel, log: JointLog) -> None:
    rng = np.random.default_rng(0)
    more = 0.2 * rng.standard_normal(len(log.time))
    loud = replace(log, torque=log.torque + more[:, None] * ELBOW)
    quiet, louder = (trials_of(model, [x]).noise[0].std(axis=0) for x in (log, loud))
    np.testing.assert_allclose(louder[:2], quiet[:2], rtol=0.05)
    assert louder[2] > 4.0 * quiet[2]


# --- what is not listed, and what is left out


def test_what_no_table_lists_is_located(model: SerialModel, log: JointLog) -> None:
    torque = log.torque + 0.3 * np.sin(5.0 * log.q) * ELBOW
    verdict = judged(model, [replace(log, torque=torque)], excluded=["ripple"])
    (finding,) = (f for f in verdict.findings if f.cause == "unlisted")
    assert (finding.place, finding.of) == ("elbow", "position")
    assert finding.probability > 0.5
    assert finding.law is not None
    told = finding.law.to_dict()
    assert (told["targets"], told["of"], told["unit"]) == (["torque_3"], "q_3", "N m")
    assert set(told["units"]) == set(finding.members[0].values)
    away = np.subtract(told["traces"][0]["error"][0], told["traces"][0]["law"][0])
    assert np.std(away) < 0.1 * np.std(told["traces"][0]["error"][0]) + 0.02
    assert {f.place for f in verdict.findings} == {"elbow"}
    assert verdict.verdict != "explained"


def test_causes_that_are_left_out_are_not_named(model: SerialModel, log: JointLog) -> None:
    with pytest.raises(InputError, match="cause 'grease' does not exist"):
        judged(model, [log], excluded=["grease"])
    off = replace(log, torque=log.torque + 0.4 * ELBOW)
    out = ["torque_offset", "asymmetric_coulomb"]
    assert what(judged(model, [off])) == {("torque_offset", "elbow")}
    verdict = judged(model, [off], excluded=out)
    told = {f.cause for f in verdict.findings} | {key[0] for f in verdict.findings for key in f.told}
    assert not told & set(out)
    assert verdict.findings
    assert not {offer.cause for offer in (*verdict.before, *verdict.after)} & set(out)


def test_what_is_within_a_tolerance_is_no_news(model: SerialModel, log: JointLog) -> None:
    """A scale that is off by 15 %, with the usual tolerance of 2 % and with one of 15 %."""
    scaled = replace(log, torque=log.torque * (1.0 - 0.15 * ELBOW))
    assert what(judged(model, [scaled])) == {("torque_scale", "elbow")}
    verdict = judged(model, [scaled], tolerances={"torque_scale": {"scale": 0.15}})
    assert what(verdict) == set()
    assert verdict.verdict == "consistent"


# --- standard errors


def test_standard_errors_are_those_of_many_draws(model: SerialModel) -> None:
    """An offset and a rotor in logs that differ in motion and noise."""

    def rotor(spec: mujoco.MjSpec) -> None:
        spec.joint("turn").armature = 0.05

    true, errors = {"elbow offset_Nm": 0.3, "turn armature_kgm2": 0.05}, []
    for seed in range(12):
        log = part(arm_log(both(NAMED, rotor), 100 + seed), most=round(10.0 * RATE_HZ))
        trials = trials_of(model, [replace(log, torque=log.torque + 0.3 * ELBOW)])
        problem = joint_problem(model, trials.runs, None, Given(noise=trials.noise))
        search = Search(problem, floor_of(problem, problem.slabs()))
        hidden = [g for g in problem.groups if g.key in (("torque_offset", "elbow"), ("armature", "turn"))]
        found = labels_of(Outcome(problem, search, search.fixed([Chosen(g, 1.0) for g in hidden])))
        assert set(found) == set(true)
        errors += [(found[name][0] - true[name]) / found[name][1] for name in true]
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.4


# --- encoders that hold their last value


def test_an_encoder_that_holds_its_value_is_told_and_nothing_besides(
    model: SerialModel, log: JointLog
) -> None:
    q, length = log.q.copy(), round(0.13 * RATE_HZ)
    for start in range(round(1.1 * RATE_HZ), len(q) - length, round(1.7 * RATE_HZ)):
        q[start : start + length, 1] = q[start, 1]
    verdict = judged(model, [replace(log, q=q)])
    (found,) = verdict.findings
    assert (found.cause, found.joint, verdict.verdict) == ("unlisted", 2, "explained")
    assert found.event is not None
    assert found.event.duration_s == pytest.approx(0.13, abs=0.04)
    assert found.shape["share"] == pytest.approx(0.13 / 1.7, rel=0.3)
    assert any("holds its last value" in note for note in verdict.notes)
