"""Numbers as the report prints them, and the series and statistics that it draws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discrepancy.numbers import fitting, one_each, parameter
from discrepancy.result.traces import Trace, binned, running_rms, spectrum
from mocobot_report.charts import thinned
from mocobot_report.numbers import (
    about,
    measured,
    percent,
    plain,
    probability,
    short_names,
    size,
    spelled,
    with_error,
)

SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def parsed(text: str) -> float:
    mantissa, _, exponent = text.replace("\u2212", "-").replace("\u00a0", "").partition("×10")
    return float(mantissa) * 10.0 ** int(exponent.translate(SUPERSCRIPTS) or 0)


@given(st.floats(1e-30, 1e30) | st.floats(-1e30, -1e-30), st.integers(1, 6))
def test_plain_numbers_keep_their_digits(value: float, digits: int) -> None:
    assert parsed(plain(value, digits)) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))


def test_plain_numbers_are_short() -> None:
    assert [plain(v) for v in (0.0, 11.672, 0.000123, 99.96, 5.6e-5, -3.0)] == [
        "0", "11.7", "0.000123", "100", "5.60\u00a0×\u00a010⁻⁵", "\u22123.00",
    ]  # fmt: skip
    assert plain(None) == plain(float("nan")) == plain(float("inf")) == "–"


@given(st.floats(-1e4, 1e4), st.floats(1e-7, 1e3))
def test_value_and_error_have_the_same_digits(value: float, se: float) -> None:
    shown, error = measured(value, se)
    assert parsed(error) == pytest.approx(se, rel=0.051)
    assert abs(parsed(shown) - value) <= 0.051 * se + 1e-12 * abs(value)
    assert len(shown.partition(".")[2]) == len(error.partition(".")[2])


def test_measured_numbers_of_every_kind() -> None:
    assert measured(11.671964, 0.00019) == ("11.67196", "0.00019")
    assert measured(1234.5, 31.0) == ("1234", "31")
    assert measured(123456.0, 5200.0) == ("123500", "5200")
    assert measured(2.0, None) == ("2.000", "")
    assert measured(None, 1.0) == ("–", "")
    assert with_error(2.0, 0.1, "kg") == "2.00 ±\u00a00.10\u00a0kg"


def test_shares_ratios_sizes_and_probabilities() -> None:
    shown = [percent(v).replace("\u00a0", " ") for v in (0.5, 0.994, 1.0, 0.9999, 0.000016, -0.2, None)]
    assert shown == ["50 %", "99.4 %", "100 %", "100 %", "0.0016 %", "\u221220 %", "–"]
    shown = [probability(v).replace("\u00a0", " ") for v in (1.0, 0.9995, 0.9985, 0.5, 0.004, 0.0)]
    assert shown == ["> 99.9 %", "> 99.9 %", "99.9 %", "50 %", "0.40 %", "< 0.1 %"]
    assert [about(v).replace("\u00a0", " ") for v in (53325.0, 97.3, 1.13, 0.4)] == [
        "53 000",
        "97",
        "1.1",
        "0.40",
    ]
    assert [size(v).replace("\u00a0", " ") for v in (12, 4300, 5_458_685)] == ["12 B", "4.3 kB", "5.5 MB"]


def test_units_fit_the_size() -> None:
    assert fitting("rad", 3e-5) == ("urad", 1e6)
    assert fitting("m/N", 2e-5) == ("um/N", 1e6)
    assert fitting("m", 0.02) == ("mm", 1e3)
    assert fitting("N", 0.5) == ("N", 1.0)
    assert fitting("parrots", 1e-9) == ("parrots", 1.0)
    found = one_each([("rad", 3e-5), ("rad", -2e-3), ("m", 1e-5), ("", 4.0)])
    assert found == {"rad": ("mrad", 1e3), "m": ("um", 1e6), "": ("", 1.0)}
    assert [spelled(unit) for unit in ("um/N", "urad", "us", "N/um")] == ["µm/N", "µrad", "µs", "N/µm"]


def test_parameters_carry_their_units() -> None:
    found = {name: parameter(name) for name in (
        "coulomb_Nm", "viscous_Nms_per_rad", "cubic_Nm_per_rad3", "time_constant_s", "scale", "excess_per_s",
        "stiffness_N_per_m", "force_x_N", "base_radius_m", "x_mps", "made_up",
    )}  # fmt: skip
    assert found == {
        "coulomb_Nm": ("coulomb", "N m"), "viscous_Nms_per_rad": ("viscous", "N m s/rad"),
        "cubic_Nm_per_rad3": ("cubic", "N m/rad^3"), "time_constant_s": ("time constant", "s"), "scale": ("scale", ""),
        "excess_per_s": ("excess", "1/s"), "stiffness_N_per_m": ("stiffness", "N/m"), "force_x_N": ("force x", "N"),
        "base_radius_m": ("base radius", "m"), "x_mps": ("x", "m/s"), "made_up": ("made up", ""),
    }  # fmt: skip


def test_every_parameter_of_the_catalogues_has_a_unit() -> None:
    from discrepancy.team.causes import CAUSES as TEAM

    names = {name for cause in TEAM.values() for name in cause.parameters}
    assert len(names) > 25
    assert {name for name in names if not parameter(name)[1]} == {"scale"}


def test_trials_have_short_and_distinct_names() -> None:
    given_names = ["/a/b/trial1.parquet", "c\\trial1.parquet", "trial1", ".parquet", "arm 0.2-6 s"]
    assert short_names(given_names) == ["trial1", "trial1 (2)", "trial1 (3)", "trial", "arm 0.2-6 s"]


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(1, 5000), st.integers(10, 400))
def test_thinning_loses_no_spike(seed: int, columns: int, rows: int, most: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((rows, columns))
    values[rng.integers(rows), rng.integers(columns)] = 50.0
    time = np.arange(rows) * 0.01 + np.where(np.arange(rows) > rows // 2, 3.0, 0.0)
    kept, shown = thinned(time, values, 0.01, most)
    assert len(kept) <= max(most, 2 * 2 * columns) + 6 or rows <= most + 1
    np.testing.assert_array_equal(np.nanmax(shown, axis=0), values.max(axis=0))
    np.testing.assert_array_equal(np.nanmin(shown, axis=0), values.min(axis=0))
    pauses = np.isnan(kept)
    assert pauses.sum() == (1 if rows // 2 + 1 < rows else 0)
    np.testing.assert_array_equal(np.isnan(shown).all(axis=1), pauses)
    rows_kept = np.searchsorted(time, kept[~pauses] - 1e-9)
    np.testing.assert_array_equal(shown[~pauses], values[rows_kept])
    assert np.all(np.diff(kept[~pauses]) > 0)
    assert {rows_kept[0], rows_kept[-1]} == {0, rows - 1}


def white(rows: int, rate_hz: float = 12.5, seed: int = 1) -> Trace:
    rng = np.random.default_rng(seed)
    y = rng.standard_normal((rows, 4))
    time, speed = np.arange(rows) / rate_hz, rng.uniform(0.0, 1.0, rows)
    return Trace(
        "t", time, rows, rate_hz, y, y, np.ones_like(y), y * (1.0 + 9.0 * speed[:, None]), y, {"speed": speed}
    )


def test_white_noise_is_one_everywhere() -> None:
    traces = [white(6000), white(4000, seed=2)]
    frequency, height = spectrum(traces, "white_after", [0, 1])
    assert frequency[-1] <= 6.25
    assert height == pytest.approx(1.0, abs=0.15)
    assert np.sqrt(np.mean(height**2)) == pytest.approx(1.0, abs=0.02)
    x, y = binned(traces, "white_after", [2], "speed")
    assert len(x) == 12
    assert y == pytest.approx(1.0, abs=0.1)
    assert running_rms(traces[0].white_after[:, 0] ** 2, 12.5).mean() == pytest.approx(0.98, abs=0.03)


def test_a_tone_stands_at_its_frequency_and_growth_shows() -> None:
    trace = white(4000)
    trace.white_after[:, 0] += 8.0 * np.sin(2 * np.pi * 1.7 * trace.time)
    frequency, height = spectrum([trace], "white_after", [0])
    assert frequency[np.argmax(height)] == pytest.approx(1.7, abs=0.1)
    x, y = binned([trace], "white_before", [3], "speed")
    np.testing.assert_allclose(y, 1.0 + 9.0 * x, rtol=0.12)


def test_short_trials_have_no_spectrum() -> None:
    assert spectrum([white(10)], "white_after", [0]) is None
    assert spectrum([white(10), white(20)], "white_after", [0]) is not None
    assert len(running_rms(np.zeros(0), 12.5)) == 0
    np.testing.assert_allclose(running_rms(np.full(3, 4.0), 100.0), 2.0)
