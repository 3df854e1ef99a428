"""Effects that no catalogue lists, at the joints of a simulated arm whose model is off by a tenth everywhere."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.laws.places import POSITION, TORQUE
from discrepancy.serial.laws.rig import LawfulSerialRig

from discrepancy.candidate import Parameter
from discrepancy.joints.mechanics.tree import Tree
from discrepancy.joints.model import SerialModel
from discrepancy.joints.signals import Signals
from discrepancy.laws.candidate import LawCandidate, candidate_of
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.result.diagnosed import Diagnosed
from discrepancy.rules import LAW_INSTEAD
from estimator.errors import InputError
from mocobot_sim.serial.extended import load_effects, step
from mocobot_sim.serial.law import ActingLaw, JointLaw, State
from serial_made import a_little_off, nominal, simulated, spec


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return nominal(tmp_path_factory.mktemp("arm"))


def real(seed: int) -> mujoco.MjModel:
    return a_little_off(spec(), np.random.default_rng(seed)).compile()


def laws(found: Diagnosed) -> list[LawCandidate]:
    return [f.candidate for f in found.diagnosis.causes if isinstance(f.candidate, LawCandidate)]


def warming(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
    """Dry friction of the elbow that falls from 0.8 to 0.3 N m as its grease warms up."""
    out = np.zeros_like(q)
    out[2] = np.tanh(v[2] / 0.005) * (0.3 + 0.5 * np.exp(-time / 8.0))
    return out


def one_sided(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
    """A cable at the shoulder that pulls from 0.2 rad on."""
    out = np.zeros_like(q)
    out[1] = 2.0 * max(q[1] - 0.2, 0.0)
    return out


@pytest.fixture(scope="module")
def warm(model: SerialModel) -> Diagnosed:
    """Without the cause of that name: laws are for what none lists."""
    return diagnose_serial(model, [simulated(real(108), 8, warming)], excluded=["warming"])


@pytest.mark.slow
def test_friction_that_warms_up(warm: Diagnosed) -> None:
    (law,) = laws(warm)
    assert (law.at.name, law.joint, law.term.function) == (TORQUE, 3, "warming")
    assert law.term.variables == ("time", "direction_3")
    cause = next(c for c in warm.to_dict()["causes"] if c["cause"] == "law")
    assert cause["parameters"]["amplitude"]["value"] == pytest.approx(-0.5, rel=0.1)
    assert cause["parameters"]["time_s"]["value"] == pytest.approx(8.0, rel=0.2)
    assert "torque of joint 3 (elbow), read or acting" in cause["sentence"].lower()
    assert "grease" in cause["sentence"]
    removed = warm.diagnosis.gain
    assert removed is not None
    assert removed.removed()[0] > 0.8
    assert warm.diagnosis.verdict == "explained"


@pytest.mark.slow
def test_the_law_is_written_and_stepped(warm: Diagnosed, tmp_path: Path) -> None:
    warm.write_into(tmp_path)
    assert (tmp_path / "law.png").stat().st_size > 10_000
    json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    robot = mujoco.MjModel.from_xml_path(str(tmp_path / "extended" / "robot.xml"))
    (acting,) = (e for e in load_effects(tmp_path / "extended") if isinstance(e, ActingLaw))
    data = mujoco.MjData(robot)
    data.time, data.qvel[2] = 16.0, 0.5
    step(robot, data, [acting], np.zeros(4))
    # By hand: after two time constants 1 - exp(-2) of the 0.5 N m are gone.
    assert data.qfrc_applied[2] == pytest.approx(0.5 * (1.0 - np.exp(-2.0)), rel=0.12)
    assert np.all(data.qfrc_applied[[0, 1, 3]] == 0.0)


@pytest.mark.slow
def test_an_encoder_that_wobbles(model: SerialModel) -> None:
    def read(q: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = q.copy()
        q[:, 1] += 0.004 * np.sin(3.0 * q[:, 1] + 0.5)
        return q, torque

    found = diagnose_serial(model, [simulated(real(4), 4, read=read)])
    law = laws(found)[0]
    assert (law.at.name, law.joint, law.term.function) == (POSITION, 2, "sine")
    assert law.term.numbers["times"] == 3.0
    values, _ = found.rig.effect_parameters(law, found.diagnosis.causes[0].values, np.zeros((2, 2)))
    assert values["amplitude"] == pytest.approx(0.004, rel=0.2)
    assert values["phase_rad"] == pytest.approx(0.5, abs=0.1)


@pytest.mark.slow
def test_on_request_a_law_is_weighed_against_causes_that_imitate_it(model: SerialModel) -> None:
    log = simulated(real(7), 7, one_sided)
    without = diagnose_serial(model, [log], laws="never")
    assert not laws(without)
    assert not without.diagnosis.located
    law = laws(diagnose_serial(model, [log], laws="always"))[0]
    assert (law.at.name, law.joint, law.term.function) == (TORQUE, 2, "above")
    assert law.term.numbers["knee"] == pytest.approx(0.2, abs=0.02)


def crosstalk(q: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The elbow's reading takes in 4 % of the shoulder's."""
    torque = torque.copy()
    torque[:, 2] += 0.04 * torque[:, 1]
    return q, torque


@pytest.mark.slow
def test_a_law_takes_the_place_of_causes_that_are_not_sure(model: SerialModel) -> None:
    log = simulated(real(9), 9, read=crosstalk)
    listed = diagnose_serial(model, [log], laws="never")
    assert listed.diagnosis.causes
    assert min(found.probability for found in listed.diagnosis.causes) < LAW_INSTEAD
    (cause,) = diagnose_serial(model, [log]).diagnosis.causes
    law = cause.candidate
    assert isinstance(law, LawCandidate)
    assert (law.at.name, law.joint, law.term.function) == (TORQUE, 3, "linear")
    assert law.term.variables == ("torque_2",)
    assert cause.values[0] == pytest.approx(0.04, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [201, 202, 203])
def test_silent_on_a_clean_arm_even_if_asked(model: SerialModel, seed: int) -> None:
    found = diagnose_serial(model, [simulated(real(seed), seed, seconds=12.0)], laws="always")
    assert not laws(found)
    assert found.diagnosis.located


def test_what_an_error_of_a_position_does(model: SerialModel) -> None:
    """Against MuJoCo's inverse dynamics of the positions with the error in them."""
    log = simulated(real(100), 0, seconds=6.0)
    rig = LawfulSerialRig.of(model, [log])
    error = 1e-3 * np.sin(2.0 * np.pi * 0.7 * log.time)
    q = log.q.copy()
    q[:, 1] += error
    signals = rig.parts[0].signals

    def inverse(*state: np.ndarray) -> np.ndarray:
        data, out = mujoco.MjData(model.model), np.empty_like(state[0])
        for k in range(len(out)):
            data.qpos[:], data.qvel[:], data.qacc[:] = (x[k] for x in state)
            mujoco.mj_inverse(model.model, data)
            out[k] = data.qfrc_inverse
        return out

    moved = Signals.of(replace(log, q=q), Tree.of(model.model), inverse)
    change = signals.inverse - moved.inverse
    (place,) = (p for p in rig.bench.places if p.name == POSITION and p.joint == 2)
    at = signals.time[rig.parts[0].blocks[1]]
    values = 1e-3 * np.sin(2.0 * np.pi * 0.7 * at)[:, None]
    column = rig.bench.moved(1, rig.bench.directions(1, place), values)[..., 0]
    expected = rig.parts[0].reduction(change)[1][:, rig.joints]
    assert np.linalg.norm(column - expected) < 0.01 * np.linalg.norm(expected)


def test_places_and_signals(model: SerialModel) -> None:
    bench = LawfulSerialRig.of(model, [simulated(real(100), 0, seconds=6.0)]).bench
    places = [(p.name, p.joint) for p in bench.places]
    assert {(TORQUE, j) for j in (1, 2, 3, 4)} <= set(places)
    (elbow,) = (p for p in bench.places if (p.name, p.joint) == (TORQUE, 3))
    # The torque that is read holds the error: it may be of the others' torques, but not of itself.
    assert "torque_3" in {v.name for v in elbow.without}
    assert "torque_3" not in {v.name for v in elbow.own}
    assert {"torque_1", "torque_3", "q_2", "direction_4", "load_1"} <= {v.name for v in bench.variables}


def named(cause: str, joint: int | None, **more: object) -> SerialCandidate:
    return SerialCandidate(cause, cause, None, joint, (Parameter("size", 0.0, 1.0),), **more)  # type: ignore[arg-type]


def test_laws_that_are_listed_causes_in_another_form(model: SerialModel) -> None:
    bench = LawfulSerialRig.of(model, [simulated(real(100), 0, seconds=6.0)]).bench
    signals = {v.name: v for v in bench.variables}
    torque = {p.joint: p for p in bench.places if p.name == TORQUE}
    position = {p.joint: p for p in bench.places if p.name == POSITION}

    def law(at: Place, function: str, of: str, **numbers: float) -> LawCandidate:
        return candidate_of(at, Term(function, signals[of], numbers), 1.0, 100)

    bent, dry = law(torque[3], "cube", "load_3"), law(torque[3], "play", "q_3", half_width=1e-3)
    assert bench.is_form(bent, named("torque_scale", 3))
    assert bench.is_form(law(torque[3], "spline", "load_3", low=-1.0, step=0.3), named("torque_scale", 3))
    assert bench.is_form(dry, named("friction", 3))
    assert not bench.is_form(bent, named("torque_scale", 2))
    assert not bench.is_form(bent, named("friction", 3))
    assert not bench.is_form(
        law(torque[3], "linear", "torque_2"), named("torque_scale", 3)
    )  # that is cross-talk
    assert not bench.is_form(law(position[3], "play", "q_3", half_width=1e-3), named("friction", 3))
    # Beside whatever has a form at that joint, or at the pair that it belongs to, and the whole arm.
    assert bench.beside(torque[3], named("torque_scale", 3), named=True)
    assert bench.beside(torque[3], named("coupled_drive", 4, part="pair", partner=3), named=True)
    assert not bench.beside(torque[2], named("coupled_drive", 4, part="pair", partner=3), named=True)
    assert bench.beside(torque[2], named("push", None), named=True)
    assert not bench.beside(torque[2], named("push", None), named=False)
    assert not bench.beside(
        torque[3], named("payload", None), named=True
    )  # a number, which has no other form
    assert not bench.beside(torque[3], named("link_mass", 3), named=True)


STATE = State(
    3.0, 1e-3, np.array([0.1, 0.2]), np.array([0.0, -0.5]), np.zeros(2), np.zeros(2), np.array([4.0, 0.0])
)


def test_laws_of_other_signals() -> None:
    """Cross-talk, and friction that goes with the place, by hand."""
    crossed = JointLaw("torque_2", "linear", "torque_1", 0.05)
    assert ActingLaw(crossed).torque(STATE) == pytest.approx(0.2)
    tight = JointLaw("torque_2", "sine", "q_2", 0.3, 2.0, 0.0, 0.1, "direction_2")
    assert ActingLaw(tight).torque(STATE) == pytest.approx(-0.3 * np.sin(0.5), rel=1e-6)


def test_a_law_remembers_within_a_run() -> None:
    """A play of 0.05 rad half width: pushed against one side, it stays behind by its half width."""
    acting = ActingLaw(JointLaw("torque_1", "play", "q_1", 2.0, 0.05))
    out = [acting.torque(replace(STATE, q=np.array([x, 0.0]))) for x in (0.0, 0.03, 0.2, 0.19)]
    assert out == pytest.approx([0.0, -1.2, -2.0, -1.6])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"target": "elbow"}, "target is 'elbow'"),
        ({"function": "power"}, "function is 'power'"),
        ({"of": "phi_2_1"}, "of is 'phi_2_1'"),
        ({"times": "q"}, "times is 'q'"),
        ({"function": "lag", "number": 0.0}, "number is 0.0"),
    ],
)
def test_laws_that_are_none(values: dict[str, object], message: str) -> None:
    good = JointLaw("torque_1", "linear", "q_1", 1.0).to_dict()
    assert JointLaw.of_dict(good, "effects.json").of == "q_1"
    with pytest.raises(InputError, match=message):
        JointLaw.of_dict(good | values, "effects.json")
