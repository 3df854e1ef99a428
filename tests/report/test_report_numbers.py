"""Numbers as the report prints them, and the series and statistics that it draws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discrepancy.numbers import parameter
from discrepancy.result.traces import Trace, binned, running_rms, spectrum
from mocobot_report.charts import thinned
from mocobot_report.numbers import (
    measured,
    with_error,
)


def test_measured_numbers_of_every_kind() -> None:
    assert measured(11.671964, 0.00019) == ("11.67196", "0.00019")
    assert measured(1234.5, 31.0) == ("1234", "31")
    assert measured(123456.0, 5200.0) == ("123500", "5200")
    assert measured(2.0, None) == ("2.000", "")
    assert measured(None, 1.0) == ("–", "")
    assert with_error(2.0, 0.1, "kg") == "2.00 ±\u00a00.10\u00a0kg"


def test_every_parameter_of_the_catalogues_has_a_unit() -> None:
    from discrepancy.team.causes import CAUSES as TEAM

    names = {name for cause in TEAM.values() for name in cause.parameters}
    assert len(names) > 25
    assert {name for name in names if not parameter(name)[1]} == {"scale"}


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
