"""A payload of two bodies is named with its division, axis and spring; rigid payloads stay silent."""

import json

import numpy as np
import pytest

from discrepancy.result.read import read_diagnosis
from discrepancy.team.two_bodies import find_joint
from mocobot_sim.effects import make_effect
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_sim.trial.truth import GroundTruth


def _recordings(payload, preset, trials=("random", "periodic"), effects=()):
    made = []
    for trial in trials:
        request = TrialRequest(payload, trial, seed=1, vias=12, duration_s=15.0)
        made.append(simulate(request, [sensor_preset(preset)], effects=effects).recordings[preset])
    return made


def test_a_sprung_joint_is_named_with_its_size(tmp_path):
    found = find_joint(_recordings("flexible", "nominal"))
    truth = GroundTruth.of(build_team("flexible"))
    assert found is not None
    assert found.joint.halves == ((1,), (2, 3))
    values = json.loads(json.dumps(found.to_dict()))
    cause = values["causes"][0]
    assert values["verdict"] == "explained"
    assert cause["parameters"]["stiffness_Nm_per_rad"]["value"] == pytest.approx(70.0, rel=0.02)
    assert cause["explained"]["held_out"] > 0.99
    assert abs(found.joint.axis @ truth.joint.axis_1) > np.cos(2e-3)
    assert "between robot 1 and robots 2, 3" in str(found)
    found.write_into(tmp_path)
    assert read_diagnosis(tmp_path).causes[0].name == "payload_joint"
    again = GroundTruth.of(build_team(tmp_path / "as_found" / "payload.xml"))
    assert again.mass_kg == pytest.approx(truth.mass_kg, rel=5e-3)
    assert again.joint.stiffness == pytest.approx(70.0, rel=0.02)
    assert again.joint.second == truth.joint.second


def test_uncalibrated_robots_show_a_hinge():
    found = find_joint(_recordings("hinged", "uncalibrated"))
    assert found is not None
    assert (found.joint.motion, found.joint.halves) == ("hinged", ((1,), (2, 3)))
    axis = GroundTruth.of(build_team("hinged")).joint.axis_1
    assert abs(found.joint.axis @ axis) > np.cos(np.deg2rad(2.0))
    assert found.estimate is None
    assert "no estimate of both bodies" in found.verbose_text()


@pytest.mark.parametrize(
    ("preset", "effects"),
    [
        ("uncalibrated", []),
        ("nominal", [make_effect("base_compliance", {"compliance_m_per_N": 3e-4}, 1)]),
        ("nominal", [make_effect("base_creep", {"start_s": 2.0, "x_mps": 1e-3, "y_mps": 3e-4}, 1)]),
    ],
    ids=["uncalibrated", "compliant base", "creeping base"],
)
def test_rigid_payloads_stay_silent(preset, effects):
    assert find_joint(_recordings("a", preset, effects=effects)) is None
