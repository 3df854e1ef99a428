"""What has changed between two logs of one arm, whose model is off by a tenth everywhere and knows no friction."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.rig import SerialRig

from discrepancy.joints.model import SerialModel
from discrepancy.result.diagnosed import Diagnosed
from mocobot_logs.joints.joint_log import JointLog
from serial_made import a_little_off, nominal, simulated, spec

FRICTION = {"waist": 1.0, "shoulder": 1.5, "elbow": 0.8, "roll": 0.2}


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return nominal(tmp_path_factory.mktemp("arm"))


def real() -> mujoco.MjSpec:
    made = a_little_off(spec(), np.random.default_rng(7))
    for name, size in FRICTION.items():
        joint = made.joint(name)
        joint.frictionloss, joint.damping = size, [size, 0.0, 0.0]
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    return made


@pytest.fixture(scope="module")
def healthy() -> JointLog:
    return simulated(real().compile(), 0)


def named(found: Diagnosed) -> list[tuple[str, int | None]]:
    return [(f.candidate.cause, f.candidate.joint) for f in found.diagnosis.causes]


def test_doubled_friction(model: SerialModel, healthy: JointLog, tmp_path) -> None:
    changed = real()
    changed.joint("elbow").frictionloss *= 2.0
    found = diagnose_serial(model, [simulated(changed.compile(), 1)], reference=[healthy])
    assert named(found) == [("friction", 3)]
    assert found.diagnosis.verdict == "explained"
    assert found.diagnosis.causes[0].values[0] == pytest.approx(0.8, abs=0.03)
    assert abs(found.diagnosis.causes[0].values[1]) < 0.03
    assert len(found.traces()) == 4
    assert re.search(
        r"rubs with 0\.\d+ \+- 0\.\d+ N m more than in the reference", " ".join(str(found).split())
    )
    found.rig.write_extended(found.diagnosis.explanation, tmp_path / "extended")
    told = (tmp_path / "extended" / "README.md").read_text(encoding="utf-8")
    assert "has changed since the reference; what is wrong with the model in both is not in it" in told


@pytest.mark.slow
def test_moved_zero(model: SerialModel, healthy: JointLog) -> None:
    moved = simulated(
        real().compile(), 1, read=lambda q, torque: (q + np.array([0.0, 0.0, 0.005, 0.0]), torque)
    )
    found = diagnose_serial(model, [moved], reference=[healthy])
    assert named(found) == [("joint_zero", 3)]
    assert found.diagnosis.causes[0].values[0] == pytest.approx(-5e-3, abs=1.5e-3)


@pytest.mark.slow
def test_payload(model: SerialModel, healthy: JointLog) -> None:
    loaded = real()
    load = loaded.body("hand").add_body()
    load.mass, load.ipos, load.fullinertia = 2.0, [0.0, 0.0, 0.1], [4e-3, 4e-3, 3e-3, 0.0, 0.0, 0.0]
    load.explicitinertial = True
    found = diagnose_serial(model, [simulated(loaded.compile(), 1)], reference=[healthy])
    assert named(found) == [("payload", 4)]
    assert found.diagnosis.causes[0].values[0] == pytest.approx(2.0, abs=0.02)
    assert found.diagnosis.causes[0].candidate.shape["z_m"] == pytest.approx(0.1, abs=2e-3)


@pytest.mark.slow
def test_nothing_has_changed(model: SerialModel, healthy: JointLog) -> None:
    found = diagnose_serial(model, [simulated(real().compile(), 1)], reference=[healthy])
    assert found.diagnosis.verdict == "consistent"


def test_links_carry_more_but_do_not_grow(model: SerialModel, healthy: JointLog) -> None:
    rig = SerialRig.of(model, [healthy], reference=[healthy])
    sought = {c.key: c for c in rig.candidates()}
    assert not {"link_mass", "link_com", "link_inertia"} & {c.cause for c in sought.values()}
    assert [c.joint for c in sought.values() if c.cause == "payload"] == [2, 3, 4]
    values = np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    gone, covariance = sought["payload", None, 2], 1e-6 * np.eye(7)
    assert rig.possible(gone, values, covariance)
    assert rig.possible(gone, -values, covariance)
    # Half a kilogram whose moments of inertia no mass has: one is more than the other two together.
    assert not rig.possible(gone, np.array([0.5, 5e-3, 0.0, 0.0, 0.0, 0.0, 0.0]), 1e-12 * np.eye(7))
    alone = SerialRig.of(model, [healthy])
    assert not alone.possible(gone, values, covariance)
    assert [c.joint for c in alone.candidates() if c.cause == "payload"] == [4]
