"""Friction, hysteresis and lags against closed forms and a general integrator."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sealed.form import BoucWen, Dahl, Lugre, Play, SecondOrderLag

DT = 1e-3


def _lugre() -> Lugre:
    return Lugre(0.05, 0.08, 0.02, 100.0, 0.1, 0.01)


@pytest.mark.parametrize("rate", [-0.3, -0.02, 0.004, 0.05])
def test_lugre_ends_on_stribecks_curve(rate):
    law = _lugre()
    for _ in range(20_000):
        torque = law.step(rate, DT)
    stribeck = 0.05 + 0.03 * np.exp(-((rate / 0.02) ** 2))
    assert torque == pytest.approx(np.sign(rate) * stribeck + 0.01 * rate, rel=1e-9)
    assert law.steady(rate) == pytest.approx(torque, rel=1e-9)


def test_lugre_is_what_its_equation_says():
    """Against a general integrator, for a motion that stops and turns."""
    rate = lambda t: 0.05 * np.sin(2.0 * np.pi * t) ** 3  # noqa: E731

    def slope(t, z):
        v = rate(t)
        return v - 100.0 * abs(v) * z / (0.05 + 0.03 * np.exp(-((v / 0.02) ** 2)))

    law, times = _lugre(), np.arange(0.0, 1.5, DT)
    for t in times:
        law.step(rate(t + 0.5 * DT), DT)
    exact = solve_ivp(slope, (0.0, 1.5), [0.0], rtol=1e-9, atol=1e-12, max_step=DT).y[0, -1]
    assert law.z == pytest.approx(exact, rel=2e-3)


def test_lugre_sticks_as_a_spring():
    law = _lugre()
    torques = [law.step(0.001, DT) for _ in range(50)]  # 50 urad, of 500 to 800 before it slides
    assert torques[-1] == pytest.approx(100.0 * 50e-6 + 0.1 * 0.001, rel=0.05)


@pytest.mark.parametrize("step", [1, 10])
def test_dahl_follows_the_way(step):
    """F_c (1 - exp(-sigma x / F_c)) from rest, and back on the branch of the other sign; steps do not matter."""
    law = Dahl(0.05, 40.0, 0.0)
    for _ in range(100 // step):
        up = law.step(0.02, step * DT)
    assert up == pytest.approx(0.05 * (1.0 - np.exp(-40.0 * 0.002 / 0.05)), rel=1e-9)
    for _ in range(50 // step):
        back = law.step(-0.02, step * DT)
    assert back == pytest.approx(-0.05 + (up + 0.05) * np.exp(-40.0 * 0.001 / 0.05), rel=1e-9)


def _loop_area(step, amplitude: float, cycles: int = 4, samples: int = 4000) -> float:
    """Area of the last loop of a motion between -amplitude and amplitude."""
    x = amplitude * np.sin(np.linspace(0.0, 2.0 * np.pi * cycles, cycles * samples + 1))
    force = np.array([step(a, b) for a, b in pairwise(x)])
    middle = 0.5 * (force + np.concatenate([[0.0], force[:-1]]))
    return float(np.sum((middle * np.diff(x))[-samples:]))


@pytest.mark.parametrize("amplitude", [3e-4, 1e-3, 5e-3])
def test_bouc_wens_loop_has_its_area(amplitude):
    """For beta = 1/2 and n = 1: straight while unloading, exponential while loading.

    With the way D = 2 A / d of half a cycle, z turns at Z = 1 - exp(Z - D), and a loop has 2 F d (D - 2 Z - Z^2 / 2).
    """
    force, d = 0.05, 1e-3
    way = 2.0 * amplitude / d
    turn = brentq(lambda z: z - 1.0 + np.exp(z - way), 0.0, 1.0)
    law = BoucWen(force, d, 0.5, 1.0)
    area = _loop_area(lambda a, b: law.step((b - a) / DT, DT), amplitude)
    assert area == pytest.approx(2.0 * force * d * (way - 2.0 * turn - 0.5 * turn**2), rel=2e-3)


@pytest.mark.parametrize(("beta", "exponent"), [(0.5, 1.0), (0.8, 2.0), (1.0, 1.5)])
def test_bouc_wen_ends_at_its_force(beta, exponent):
    law = BoucWen(0.05, 1e-3, beta, exponent)
    torques = [law.step(0.02, DT) for _ in range(2000)]
    assert torques[-1] == pytest.approx(0.05, rel=1e-6)
    assert np.diff(torques).min() >= 0.0


def test_plays_loop_has_its_area():
    """4 r (A - r)."""
    law = Play(0.3)
    area = _loop_area(lambda a, b: law.step(b), 1.0)
    assert area == pytest.approx(-4.0 * 0.3 * 0.7, rel=1e-3)  # it lags, so the loop runs the other way


@pytest.mark.parametrize("ratio", [0.3, 0.7, 5.0])
def test_lag_of_a_ramp(ratio):
    """Late by 2 zeta / omega, exactly."""
    law, late = SecondOrderLag(ratio / (np.pi * 0.004), ratio, DT), 0.004
    out = [law.step(3.0 + 2.0 * max(k * DT, 0.0)) for k in range(2000)]
    assert out[0] == pytest.approx(3.0, abs=1e-12)
    assert out[-1] == pytest.approx(3.0 + 2.0 * (1999 * DT - late), abs=1e-9)


@pytest.mark.parametrize("frequency", [5.0, 40.0])
def test_lag_has_its_frequency_response(frequency):
    omega_0, zeta, omega = 2.0 * np.pi * 60.0, 0.6, 2.0 * np.pi * frequency
    law, time = SecondOrderLag(60.0, zeta, DT), np.arange(4000) * DT
    out = np.array([law.step(value) for value in np.sin(omega * time)])[2000:]
    wave = np.stack([np.sin(omega * time), np.cos(omega * time)], axis=1)[2000:]
    (real, imaginary), *_ = np.linalg.lstsq(wave, out)
    exact = omega_0**2 / (omega_0**2 - omega**2 + 2j * zeta * omega_0 * omega)
    # Straight lines between ticks pass (omega dt)^2 / 12 less of a sine.
    assert abs(real + 1j * imaginary - exact) < 1.1 * (omega * DT) ** 2 / 12.0 * abs(exact) + 1e-9
