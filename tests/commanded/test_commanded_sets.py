"""Sets of robots that log commands and positions: what was simulated is what their truth says."""

import json

import numpy as np
import pytest

from commanded.forecast import by_rollout, compiled, errors, read_log
from commanded.machine import arriving, run
from commanded.make import make
from commanded.score import true_machine


def test_a_late_command_is_averaged_over_the_step_that_it_arrives_in():
    stamps, commands = np.array([0.0, 0.02, 0.04]), np.array([[1.0], [3.0], [-1.0]])
    late = arriving(stamps, commands, 0.005, np.array([0.0, 0.02, 0.024, 0.028, 0.05]))
    np.testing.assert_allclose(late[:, 0], [1.0, 1.0, 0.25 * 1.0 + 0.75 * 3.0, (17.0 * 3.0 - 5.0) / 22.0])


@pytest.mark.slow
def test_the_true_model_forecasts_a_leg_to_the_noise_of_its_encoders(tmp_path):
    make("leg", 0, 200.0, tmp_path)
    truth = json.loads((tmp_path / "truth.json").read_text())
    joints = tuple(truth["joints"])
    log = read_log(tmp_path / "held_out.csv", joints)
    model = compiled(tmp_path / "true.xml", joints, None)
    noise = np.hypot(truth["noise_rad"], 2.0 * np.pi / truth["counts_per_turn"] / np.sqrt(12.0))

    def whole(delay_s):
        return errors(model, joints, by_rollout(model, joints, log, delay_s), log, ())["whole"]

    delay = truth["joints"][joints[0]]["delay_s"]
    np.testing.assert_allclose(whole(delay), noise, rtol=0.1)
    assert (whole(delay - 1e-3) > 1.5 * noise).all()


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["M1", "M4"])
def test_friction_of_a_servo_holds_it_up_to_its_budget(tmp_path, friction):
    """The first axis stands upright: nothing but friction stands against its drive."""
    make("arm", 1, 30.0, tmp_path, friction=friction)
    law = json.loads((tmp_path / "truth.json").read_text())["friction_law"]
    own = {name: value[0] for name, value in law.items()}
    machine = true_machine(tmp_path)
    holds = (own["base"] + own["stribeck"]) / (1.0 - own["motor"] - own["motor_stribeck"])
    stamps, pose = np.arange(31) / 30.0, np.array([0.0, -0.7, 0.9, 0.2, 0.0, 0.6])
    for share, moves in ((0.95, False), (1.05, True)):
        commands = np.tile(pose, (31, 1))
        commands[1:, 0] += share * holds / machine.kp[0]
        q = run(machine, stamps, commands).q[:, 0]
        assert (abs(q[-1] - q[0]) > 0.05 * holds / machine.kp[0]) == moves
