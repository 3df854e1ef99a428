"""Friction that thins, and readings whose scale depends on the load: laws that bend."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from discrepancy.causes.numbers import Numbers
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.sublinear_friction import line_of, thinning
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.rig import SerialRig
from mocobot_sim.serial.effects import DRY, RobotEffect
from serial_made import a_little_off, nominal, simulated, spec


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> SerialRig:
    folder = tmp_path_factory.mktemp("arm")
    return SerialRig.of(nominal(folder), [simulated(spec().compile(), 5, seconds=6.0)])


@pytest.mark.parametrize("exponent", [0.3, 0.7])
@pytest.mark.parametrize("thins", [0.0, 0.02, 0.3, 1.5])
def test_the_line_taken_out_is_the_nearest(exponent: float, thins: float) -> None:
    """What is left has no mean and no slope on 0 to 2, by adaptive quadrature."""
    constant, slope = line_of(exponent, thins)

    def left(u: float) -> float:
        return float(thinning(np.array(u), exponent, thins)) - constant - slope * u

    for moment in (left, lambda u: u * left(u)):
        assert quad(moment, 0.0, 2.0, points=[0.01, 0.1], limit=200)[0] == pytest.approx(0.0, abs=2e-4)


def test_what_thins_is_viscous_when_slow_and_a_power_when_fast() -> None:
    slow, fast = np.array([1e-4, 2e-4]), np.array([50.0, 200.0])
    np.testing.assert_allclose(thinning(slow, 0.5, 0.3), slow * 0.3**-0.5, rtol=1e-6)
    np.testing.assert_allclose(thinning(fast, 0.5, 0.3), fast**0.5, rtol=1e-4)


@pytest.mark.parametrize("thins", [0.0, 0.2, 1.0])
def test_the_simulator_has_the_same_friction(rig: SerialRig, thins: float) -> None:
    """Its line has closed forms; the column's is by quadrature."""
    s, typical = rig.parts[0].signals, float(rig.hints.typical[2])
    shape = {"exponent": 0.4, "thins_per_s": thins * typical, "typical_per_s": typical}
    assert shape.keys() == CAUSES["sublinear_friction"].shapes(rig.hints, 2)[0].keys()
    column = CAUSES["sublinear_friction"].columns(s, 2, shape)[:, 2, 0]
    effect = RobotEffect("sublinear_friction", 3, None, {"bend_Nm": 1.0} | shape)
    fast = np.abs(s.dq[:, 2]) > s.slow[2]
    level = [DRY["sublinear_friction"](effect, float(v), 0.0, 0.0) for v in s.dq[fast, 2]]
    np.testing.assert_allclose(column[fast], np.sign(s.dq[fast, 2]) * level, atol=1e-4)


def test_finer_shapes_stay_what_they_are() -> None:
    cause = CAUSES["sublinear_friction"]
    plain = {"exponent": 0.5, "thins_per_s": 0.0, "typical_per_s": 2.0}
    assert [s["thins_per_s"] for s in cause.finer(plain)] == [0.0, 0.0]
    near = cause.finer(plain | {"thins_per_s": 0.5})
    assert sorted({s["thins_per_s"] for s in near}) == pytest.approx([0.3, 0.5, 0.75])


def test_a_bent_scale_is_what_it_says(rig: SerialRig) -> None:
    """At the typical load as a straight one; slopes over the bend are exact, since it is linear in that."""
    s, cause = rig.parts[0].signals, CAUSES["torque_scale"]
    plain = cause.shapes(rig.hints, 1)[0]
    load = plain["typical_load"]
    assert load == pytest.approx(float(np.sqrt(np.mean(s.inverse[:, 1] ** 2))))
    straight = cause.columns(s, 1, plain)[:, 1, 0]
    bent = cause.columns(s, 1, plain | {"bend": -0.3})[:, 1, 0]
    np.testing.assert_allclose(straight, s.asked[:, 1])
    np.testing.assert_allclose(bent, straight * (1.0 - 0.3 * (np.abs(straight) / load - 1.0)))
    assert not cause.steps(plain)
    assert set(cause.steps(plain | {"bend": 0.2})) == {"bend"}


def test_what_a_volt_is_worth_does_not_bend(rig: SerialRig) -> None:
    """It was fitted to the loads that would say so."""
    told = rig.hints
    fitted = replace(told, unscaled=np.arange(len(told.load)) == 1)
    assert len(CAUSES["torque_scale"].shapes(told, 1)) > 1
    assert len(CAUSES["torque_scale"].shapes(fitted, 1)) == 1
    assert {s["thins_per_s"] for s in CAUSES["sublinear_friction"].shapes(fitted, 1)} == {0.0}


def test_a_scale_within_two_tolerances_does_not_bend(rig: SerialRig) -> None:
    """A plain one may be as small as the data tell."""
    (plain,) = (c for c in rig.candidates() if (c.cause, c.joint) == ("torque_scale", 2))
    bent = replace(plain, shape=plain.shape | {"bend": 0.2})
    for scale, one, can in (
        (0.02, plain, True),
        (0.02, bent, False),
        (-0.05, bent, True),
        (0.8, bent, False),
    ):
        assert rig.possible(one, np.array([scale]), np.eye(1) * 1e-6) is can


@pytest.mark.slow
def test_a_drive_that_saturates_is_a_scale_that_bends(tmp_path: Path) -> None:
    """Its reading is a fourth too large at rest, and less so the larger the torque."""
    hidden = a_little_off(spec(), np.random.default_rng(120)).compile()

    def read(q: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        torque = torque.copy()
        torque[:, 2] += 0.25 * 8.0 * np.tanh(torque[:, 2] / 8.0)
        return q, torque

    log = simulated(hidden, 10, seconds=24.0, read=read)
    found = diagnose_serial(nominal(tmp_path), [log], laws="never", closed_loop=False)
    (cause,) = found.to_dict()["causes"]
    assert (cause["cause"], cause["joint"]) == ("torque_scale", 3)
    assert cause["parameters"]["bend"]["value"] < -3.0 * cause["parameters"]["bend"]["se"]
    load = cause["parameters"]["typical_load"]["value"]
    told = cause["parameters"]["scale"]
    assert abs(told["value"] - 2.0 * np.tanh(load / 8.0) / load) < 0.06
    assert "as where a reading saturates" in cause["sentence"]


def test_what_saturates_is_told_from_the_sign() -> None:
    """Iron that saturates gives less than a current says: what is read over what is there grows with the load."""
    cause = CAUSES["torque_scale"]
    for scale, bend, what in ((0.2, 0.1, "iron"), (-0.2, -0.1, "iron"), (0.2, -0.1, "a reading")):
        said = cause.sentence(Numbers({"scale": scale, "bend": bend, "typical_load": 4.0}, {}))
        assert f"as where {what} saturates" in said
    assert "saturates" not in cause.sentence(Numbers({"scale": 0.2, "bend": 0.0, "typical_load": 4.0}, {}))
