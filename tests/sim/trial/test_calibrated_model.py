"""The calibrated team's model: from exact deviations it must move and read like the team that they are of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mocobot
from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.errors import InputError
from estimator.estimate.principal import inertia_parameters
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Bases
from invented_calibration import invented_calibration
from mocobot.api.simulation import SimulatedRecording
from mocobot_sim.effects.geometry import BaseTilt
from mocobot_sim.extended.extended import calibrated_team, extra_of, load_extended, write_calibrated
from mocobot_sim.scene.as_built import units_as_built
from mocobot_sim.scene.models import base_height_m, omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted, resimulate

TILTED = BaseTilt(2, 0.01, -0.02)


def exact(truth: mocobot.GroundTruth, tilted: BaseTilt) -> Calibration:
    """The calibration that a perfect fit would give."""
    invented = invented_calibration(3)
    x = np.zeros((3, COUNT))
    for robot, unit in enumerate(truth.units):
        x[robot] = np.concatenate(
            [
                unit.phi_zero_rad, unit.theta_zero_rad, unit.base_radius_m - unit.platform_radius_m,
                unit.proximal_length_m, unit.rod_length_m, unit.stiffness_ratio, unit.tau_zero_Nm, np.zeros(2),
                unit.proximal_mass_ratio, unit.rod_mass_ratio, [unit.wrist_mass_ratio],
            ]
        )  # fmt: skip
    units = ArmUnit(omnid_design(), x)
    units.of("tilt")[tilted.robot - 1] = tilted.roll_rad, tilted.pitch_rad
    c, m = truth.p_1c, truth.mass_kg
    about_c = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    J = about_c + m * (c @ c * np.eye(3) - np.outer(c, c))
    held = invented.payloads[0]
    grasps = replace(held.grasps, R_1i=truth.R_1i, p_1i=truth.p_1i)
    payload = CalibratedPayload(
        "b", grasps, np.r_[m, m * c, inertia_parameters(J)], held.covariance, held.by_scale
    )
    # {b} of every robot in {b1}; a tilted chassis turns about its mount on the floor.
    mounts = build_team("b").mounts
    top = np.array([0.0, 0.0, base_height_m()])
    lean = [tilted.tilt if robot == tilted.robot else Rotation.identity() for robot in (1, 2, 3)]
    at = np.array(
        [X.translation + X.rotation.apply(one.apply(top)) for X, one in zip(mounts, lean, strict=True)]
    )
    R1 = mounts[0].rotation
    bases = Bases((R1.inv() * mounts.rotation).as_matrix(), R1.inv().apply(at - at[0]))
    trials = tuple(replace(t, bases=bases) for t in invented.trials if t.payload is not None)
    return replace(invented, units=units, payloads=(payload,), trials=trials)


@pytest.fixture(scope="module")
def recording() -> SimulatedRecording:
    return mocobot.simulate("b", "periodic", duration_s=4.0, preset=UNCALIBRATED, seed=4, effects=[TILTED])


UNCALIBRATED = replace(
    mocobot.PRESETS["uncalibrated"],
    name="test",
    spread=replace(mocobot.PRESETS["uncalibrated"].spread, arm_mass_ratio=0.05),
)


def apart(recording: Recording, scene: mocobot.TeamScene) -> dict[str, float]:
    """rms of recorded minus simulated readings, after the take-up phase."""
    simulated = predicted(resimulate(recording, scene))
    late = recording.time > 4.0
    assert late.sum() > 200
    return {
        name: float(np.sqrt(np.mean((getattr(recording, name) - getattr(simulated, name))[late] ** 2)))
        for name in ("phi", "theta", "tau")
    }


def test_it_reads_like_the_team_that_was_calibrated(recording: SimulatedRecording, tmp_path: Path) -> None:
    made = exact(recording.truth, TILTED)
    write_calibrated(made, tmp_path / "model")
    calibrated = apart(recording, load_extended(tmp_path / "model"))
    level = replace(made, units=replace(made.units, x=np.zeros((3, COUNT))))
    designed = apart(recording, calibrated_team(level))
    # Encoders step by 0.1 mrad, torques have 2 mN m of noise.
    assert calibrated["phi"] < 3e-4, calibrated
    assert calibrated["theta"] < 2e-4, calibrated
    assert calibrated["tau"] < 0.02, calibrated
    for name, left in calibrated.items():
        assert left < 0.05 * designed[name], (name, calibrated, designed)
    assert extra_of(tmp_path / "model") == {"calibrated": True, "payload": "b"}


def test_units_are_those_of_the_calibration() -> None:
    units = invented_calibration(2).units
    for unit, x in zip(units_as_built(units), units.x, strict=True):
        one = ArmUnit(units.design, x)
        np.testing.assert_array_equal(unit.base_radius_m - unit.platform_radius_m, one.of("radius"))
        np.testing.assert_array_equal(unit.stiffness_ratio, one.of("stiffness_ratio"))
        np.testing.assert_array_equal(unit.tau_zero_Nm, one.of("tau_zero"))
        assert unit.wrist_mass_ratio == one.of("wrist_mass_ratio")[0]


def test_a_flat_payload_stays_one_in_spite_of_noise() -> None:
    """A plate's largest moment is the sum of the others; noise makes it more, which no body has."""
    made = invented_calibration(2)
    plate = np.array([2.0, 0.0, 0.0, 3.0, 0.0, 5.004])  # about the centre of mass, in {1}
    held = replace(made.payloads[0], parameters=np.r_[10.0, 0.0, 0.0, 0.0, plate])
    scene = calibrated_team(replace(made, payloads=(noisy(held, 2e-3),)))
    moments = np.sort(mocobot.GroundTruth.of(scene).principal_kgm2)
    np.testing.assert_allclose(moments, [2.0, 3.0, 5.0], atol=5e-3)
    with pytest.raises(InputError, match="at most the sum of the others"):
        calibrated_team(replace(made, payloads=(noisy(held, 1e-5),)))


def noisy(payload: CalibratedPayload, sd: float) -> CalibratedPayload:
    count = len(payload.covariance)
    return replace(payload, covariance=sd**2 * np.eye(count), by_scale=np.zeros(count))


def test_what_no_model_can_be_made_of() -> None:
    made = invented_calibration(2)
    with pytest.raises(InputError, match="no recording of a payload number 2"):
        calibrated_team(made, 1)
    other = replace(made, units=ArmUnit(replace(made.design, gravity_mps2=1.6), made.units.x))
    with pytest.raises(InputError, match="of another design than the simulated Omnid"):
        calibrated_team(other)
