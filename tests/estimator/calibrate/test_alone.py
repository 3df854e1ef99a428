"""Unloaded arms: torques by Euler and Lagrange, derivatives by differences, and the masses that they give."""

from dataclasses import replace

import numpy as np
import pytest

from calibration_case import differences
from estimator.arm.dynamics import arm_torque
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Prior
from estimator.calibrate.equations import AloneEquations
from estimator.calibrate.rows import Rows, Sensing
from estimator.recording.model import Recording
from omnid_design import DESIGN
from recorded_team import STEP_S, Sines, derivatives
from recordings import metadata
from synthetic_team import carry, draw_path, draw_units, load

PRIOR = Prior(arm_mass_ratio=0.05)


def free_trial(units: ArmUnit, rng, duration_s=20.0) -> Recording:
    """Joints that follow sines of their own, nothing in the hands; the dynamics are those that MuJoCo has confirmed."""
    N = len(units.x)
    time = np.arange(round(duration_s * 100)) / 100.0
    path = Sines.draw(rng, [0.12] * 3 * N, 3, 0.1, 0.9)
    x = 0.55 + path(time[:, None] + STEP_S * np.arange(-4, 5))
    phi, phi_dot, phi_ddot = (part.reshape(-1, N, 3) for part in derivatives(x))
    tau = arm_torque(phi, phi_dot, phi_ddot, units)
    theta = np.broadcast_to(rng.uniform(-0.2, 0.2, (N, 3)), phi.shape)
    return Recording(
        time, phi + units.of("phi_zero"), theta + units.of("theta_zero"),
        tau / (1.0 + units.of("stiffness_ratio")) + units.of("tau_zero"), None,
        metadata(N, trial="free"), "free",
    )  # fmt: skip


def test_nothing_is_left_of_exact_torques_and_derivatives_are_right():
    rng = np.random.default_rng(1)
    units = draw_units(2, replace(PRIOR, tilt_rad=0.01), rng)
    recording = free_trial(units, rng, 9.0)
    rows = Rows.of(recording)
    equations = AloneEquations.of(rows.take(np.array([3, 8, 13])), Sensing.of([recording]))
    residual, J, covariance = equations.at(units)
    assert np.abs(residual).max() < 1e-6
    assert np.abs(equations.residual(ArmUnit(DESIGN, 0.0 * units.x))).max() > 0.05
    expected = differences(lambda dx: equations.residual(units.moved(dx.reshape(2, COUNT))), 2 * COUNT, 1e-6)
    expected = expected.reshape(3, 2, 3, 2, COUNT)
    for i in range(2):
        # Taken at a row's mean signals.
        assert J[:, i] == pytest.approx(expected[:, i, :, i], abs=0.02 * np.abs(expected).max())
        assert not expected[:, i, :, 1 - i].any()
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_unloaded_arms_give_their_masses():
    """Exact data, masses off by 5 %: with the free trial they are found, without it their common weight is not."""
    rng = np.random.default_rng(2)
    units, held = draw_units(3, PRIOR, rng), load(3, rng)
    carried = [carry(units, held, draw_path(held, rng), rng, 12.0).recording for _ in range(2)]
    free = free_trial(units, rng, 14.0)
    found = calibrate(carried, free=[free], prior=PRIOR)
    masses = np.r_[AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"]]
    assert np.abs(units.x[:, masses]).max() > 0.08
    assert found.units.x[:, masses] == pytest.approx(units.x[:, masses], abs=5e-3)
    assert found.payloads[0].parameters[0] == pytest.approx(held.mass, rel=2e-4)
    assert found.trials[-1].kind == "free"
    assert found.trials[-1].after[1] < 0.01
    # What the wrist weighs, a payload may weigh instead.
    wrist = AT["wrist_mass_ratio"]
    without = calibrate(carried, prior=PRIOR)
    assert without.sd[:, wrist].min() > 4.0 * found.sd[:, wrist].max()
