"""Effects in other forms than the catalogue's laws: a spring by Bouc and Wen, and a push like half a sine."""

import numpy as np
import pytest
from discrepancy.engine.diagnose import diagnose

from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from estimator.estimate.payload import estimate_payload
from mocobot_sim.effects import apply_effects
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial
from sealed.forms.pushes import HalfSinePush
from sealed.forms.springs import BoucWenSpring

pytestmark = pytest.mark.slow

SPRING = BoucWenSpring(robot=1, joint=3, force_Nm=0.15, yield_rad=1.35e-3, beta=0.7, exponent=1.6)
PUSH = HalfSinePush(
    trial=1, start_s=6.0, duration_s=2.5, rise=0.5, peak_N=2.0, along_x_m=-0.3, along_y_m=-0.6, along_z_m=-0.74,
    point_x_m=0.17, point_y_m=0.3, point_z_m=0.02,
)  # fmt: skip


def named(*effects, seed):
    rng, nominal, home = np.random.default_rng(seed), sensor_preset("nominal"), build_team("a")
    motions = [
        random_vias(home.wrist_home_b, rng, vias=8),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=10.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        team = apply_effects(build_team("a", timestep_s=1e-3), effects)
        recordings.append(
            measure(run_trial(team, motion, trial_number=number), nominal, rng, name=f"trial {number}")
        )
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    return diagnose(rig, closed_loop=False, laws="never")


def test_a_spring_that_gives_way_before_it_slips():
    """Between Prandtl's element and Dahl's: most of its limit, over about what it yields by (100 N m/rad)."""
    (found,) = named(SPRING, seed=21).causes
    assert (found.candidate.cause, found.candidate.robot, found.candidate.joint) == ("sea_hysteresis", 1, 3)
    assert found.candidate.shape["presliding_Nm"] == pytest.approx(0.135, rel=0.4)
    assert found.values[0] == pytest.approx(0.15, rel=0.25)
    assert found.probability > 0.9


def test_a_push_like_half_a_sine():
    diagnosis = named(PUSH, seed=22)
    (found,) = diagnosis.causes
    when = found.candidate.transient
    assert found.candidate.cause == "push"
    assert when.trial == 0
    assert when.start_s + 0.5 * when.duration_s == pytest.approx(7.25, abs=0.05)
    assert when.ramp_s > 0.25
    parameters, _ = diagnosis.rig.effect_parameters(found.candidate, found.values, found.covariance)
    force = [parameters[f"force_{axis}_N"] for axis in "xyz"]
    # A trapezium over half a sine is a little lower than its peak.
    assert np.linalg.norm(force) == pytest.approx(2.0, rel=0.15)
    along = PUSH.xyz("along") / np.linalg.norm(PUSH.xyz("along"))
    assert force @ along / np.linalg.norm(force) > 0.99
    assert found.probability > 0.5
