"""An arm whose model is off by a tenth everywhere, simulated by MuJoCo with one hidden cause: found, or nothing is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.rig import SerialRig

from discrepancy.joints.model import SerialModel, load_model
from discrepancy.result.diagnosed import Diagnosed
from estimator.errors import InputError
from mocobot_sim.serial.extended import load_effects, step
from serial_made import ARM, a_little_off, nominal, nominal_file, nothing, simulated, spec


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return nominal(tmp_path_factory.mktemp("arm"))


def real(seed: int) -> mujoco.MjSpec:
    return a_little_off(spec(), np.random.default_rng(seed))


def named(found: Diagnosed) -> list[tuple[str, int | None]]:
    return [(f.candidate.cause, f.candidate.joint) for f in found.diagnosis.causes]


def numbers(found: Diagnosed, k: int = 0) -> dict[str, dict[str, float]]:
    return found.to_dict()["causes"][k]["parameters"]


def test_what_is_normal_is_not_news(model: SerialModel) -> None:
    found = diagnose_serial(model, [simulated(real(100).compile(), 0)])
    assert found.diagnosis.verdict == "consistent"
    assert not found.diagnosis.causes
    assert 0.9 < found.to_dict()["residual"]["chi2_per_n"] < 1.15


def test_rest_is_not_news(model: SerialModel) -> None:
    found = diagnose_serial(model, [simulated(real(100).compile(), 0, rest=(8.0, 12.0))])
    assert found.diagnosis.verdict == "consistent"


@pytest.mark.parametrize(("link", "joint", "times"), [("fore", 3, 2.6), ("upper", 2, 2.2)])
def test_a_link_of_another_material_is_found(model: SerialModel, link: str, joint: int, times: float) -> None:
    """Of steel in place of aluminium: more than scatter may be, and centres of mass count for more in it."""
    hidden = real(104)
    before = hidden.body(link).mass
    hidden.body(link).mass *= times
    hidden.body(link).fullinertia = np.asarray(hidden.body(link).fullinertia) * times
    found = diagnose_serial(model, [simulated(hidden.compile(), 8)])
    assert named(found) == [("link_mass", joint)]
    told = numbers(found)["excess_kg"]
    modelled = spec().body(link).mass
    assert abs(told["value"] - (before * times - modelled)) < 3.0 * told["se"]
    assert told["se"] < 0.15 * told["value"]


def test_friction_is_found_at_its_joint(model: SerialModel) -> None:
    """By MuJoCo's own dry friction, a constraint, and its damping."""
    hidden = real(101)
    elbow = hidden.joint("elbow")
    elbow.frictionloss, elbow.damping = 0.5, [0.3, 0.0, 0.0]
    elbow.solref_friction, elbow.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    found = diagnose_serial(model, [simulated(hidden.compile(), 1)])
    assert named(found) == [("friction", 3)]
    assert found.diagnosis.verdict == "explained"
    for name, truth in (("coulomb_Nm", 0.5), ("viscous_Nms_per_rad", 0.3)):
        assert numbers(found)[name]["value"] == pytest.approx(truth, abs=0.01)
    assert "joint 3 (elbow)" in str(found).lower()


def test_friction_that_the_model_names_is_no_news(tmp_path: Path) -> None:
    """Neither where joints turn round, nor in the reading of a torque that is off within its tolerance."""
    rubs = ARM.replace("armature=", 'frictionloss="0.15" damping="0.2" armature=')
    hidden = a_little_off(spec(rubs), np.random.default_rng(107))
    for joint in hidden.joints:
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    scale = np.array([1.03, 0.98, 1.04, 0.97])
    log = simulated(hidden.compile(), 7, read=lambda q, torque: (q, torque * scale))
    found = diagnose_serial(load_model(nominal_file(tmp_path, rubs)), [log])
    assert not named(found)
    assert found.diagnosis.verdict == "consistent"


def test_rotors_that_the_model_names_are_off_as_its_masses_are(model: SerialModel) -> None:
    rig = SerialRig.of(model, [simulated(real(100).compile(), 0)])
    rotors = [c for c in rig.candidates() if c.cause == "armature"]
    assert [c.parameters[0].tolerance for c in rotors] == pytest.approx([6e-3, 7.5e-3, 3.6e-3, 9e-4])


def test_rotor_is_found_at_its_joint(model: SerialModel) -> None:
    hidden = real(102)
    hidden.joint("elbow").armature += 0.08
    found = diagnose_serial(model, [simulated(hidden.compile(), 2)])
    assert named(found) == [("armature", 3)]
    value = numbers(found)["armature_kgm2"]
    assert abs(value["value"] - 0.08) < 4.0 * value["se"]
    assert value["se"] < 0.01


def test_coupled_drive_is_found(model: SerialModel) -> None:
    """Friction at the sum of two joints' speeds, which acts on both."""

    def rubbing(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
        out, speed = np.zeros_like(q), v[2] + v[3]
        out[2:] = 0.3 * np.tanh(speed / 0.01) + 0.1 * speed
        return out

    found = diagnose_serial(model, [simulated(real(103).compile(), 3, rubbing)])
    assert named(found)[0] == ("coupled_drive", 4)
    assert found.diagnosis.causes[0].candidate.place == "joints 3 and 4"
    values = numbers(found)
    assert values["ratio"]["value"] == 1.0
    assert values["coulomb_Nm"]["value"] == pytest.approx(0.3, abs=0.02)
    assert values["viscous_Nms_per_rad"]["value"] == pytest.approx(0.1, abs=0.01)


@pytest.mark.slow
def test_payload_is_found(model: SerialModel, tmp_path: Path) -> None:
    hidden = real(104)
    load = hidden.body("hand").add_body()
    load.mass, load.ipos, load.fullinertia = 1.0, [0.0, 0.0, 0.1], [1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0]
    load.explicitinertial = True
    found = diagnose_serial(model, [simulated(hidden.compile(), 5)])
    assert named(found)[0] == ("payload", 4)
    values = numbers(found)
    for name, truth in (("mass_kg", 1.0), ("x_m", 0.0), ("y_m", 0.0), ("z_m", 0.1)):
        assert abs(values[name]["value"] - truth) < 4.0 * values[name]["se"], name
    found.write_into(tmp_path)
    extended = mujoco.MjModel.from_xml_path(str(tmp_path / "extended" / "robot.xml"))
    assert extended.body_mass.sum() == pytest.approx(model.model.body_mass.sum() + values["mass_kg"]["value"])


def test_extended_robot_rubs_as_found(model: SerialModel, tmp_path: Path) -> None:
    """A friction that MJCF cannot say steps beside the model; what MJCF says is in it."""

    def rubbing(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
        out = np.zeros_like(q)
        out[1] = 2.0 * np.tanh(v[1] / 0.005) * (1.0 + 1.5 * np.exp(-abs(v[1]) / 0.05)) + 0.8 * v[1]
        return out

    found = diagnose_serial(model, [simulated(real(105).compile(), 6, rubbing)])
    assert {("friction", 2), ("stribeck", 2)} <= set(named(found))
    found.write_into(tmp_path)
    extended = mujoco.MjModel.from_xml_path(str(tmp_path / "extended" / "robot.xml"))
    assert extended.dof_frictionloss[1] == pytest.approx(2.0, rel=0.1)
    effects = load_effects(tmp_path / "extended")
    assert next((e.cause, e.joint) for e in effects if e.joint == 2) == ("stribeck", 2)
    data = mujoco.MjData(extended)
    data.qvel[1] = 0.02
    mujoco.mj_forward(extended, data)
    step(extended, data, effects, np.array(data.qfrc_bias))  # its weight would stop it within the step
    dry = -data.qfrc_constraint[1] - extended.dof_frictionloss[1]
    assert dry == pytest.approx(2.0 * 1.5 * np.exp(-0.4), rel=0.25)


def test_causes_can_be_left_out(model: SerialModel) -> None:
    log = simulated(real(100).compile(), 0, seconds=6.0)
    rig = SerialRig.of(model, [log], excluded=["friction"])
    assert "friction" not in {c.cause for c in rig.candidates()}
    with pytest.raises(InputError, match="cause 'grease' does not exist"):
        SerialRig.of(model, [log], excluded=["grease"])


def test_logs_that_cannot_be_used(model: SerialModel) -> None:
    log = simulated(real(100).compile(), 0, nothing, 3.0)
    with pytest.raises(InputError, match="no torques"):
        SerialRig.of(model, [replace(log, torque=None)])
    with pytest.raises(InputError, match="long enough"):
        SerialRig.of(model, [replace(log, usable=np.zeros(len(log.time), dtype=bool))])
