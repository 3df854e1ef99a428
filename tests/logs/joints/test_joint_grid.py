"""Rates, uneven stamps, gaps: samples on an even grid against the motion in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import MAP, columns, motion, read, write_csv


def written(tmp_path, time: np.ndarray, **more: np.ndarray):
    return write_csv(tmp_path / "log.csv", columns(time) | more)


@pytest.mark.parametrize("rate_hz", [50.0, 333.0, 1000.0, 10_000.0])
def test_even_stamps_are_left_alone(tmp_path, rate_hz) -> None:
    time = np.arange(round(1.2 * rate_hz)) / rate_hz + 17.0
    (log,) = read(written(tmp_path, time))
    assert log.rate_hz == pytest.approx(rate_hz, rel=1e-6)
    assert not log.resampled
    assert log.start_s == 0.0
    np.testing.assert_allclose(log.q, motion(time)[0], rtol=1e-13)


def test_stamps_rounded_to_milliseconds_are_even(tmp_path) -> None:
    true = np.arange(900) / 300.0
    path = write_csv(tmp_path / "log.csv", columns(true) | {"t": np.round(true, 3)})
    (log,) = read(path)
    assert log.rate_hz == pytest.approx(300.0, rel=1e-5)
    assert not log.resampled
    np.testing.assert_allclose(log.q, motion(true)[0], rtol=1e-13)
    assert "rounded to 0.001 s" in log.notes[0]


def test_uneven_stamps_are_interpolated(tmp_path) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(1200) / 200.0 + rng.uniform(-0.3, 0.3, 1200) / 200.0
    (log,) = read(written(tmp_path, time))
    assert log.resampled
    assert log.rate_hz == pytest.approx(200.0, rel=0.05)
    at = log.time + log.start_s + time[0]
    np.testing.assert_allclose(log.q, motion(at)[0], atol=2e-5)
    assert "uneven" in log.notes[0]
    assert log.usable.all()


def test_noise_of_uneven_samples_is_not_amplified(tmp_path) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(2000) / 200.0 + rng.uniform(-0.3, 0.3, 2000) / 200.0
    noise = 1e-3 * rng.standard_normal((2000, 1))
    path = write_csv(
        tmp_path / "log.csv", columns(time) | {"hip.pos": np.degrees(motion(time)[0][:, 0] + noise[:, 0])}
    )
    (log,) = read(path)
    error = log.q[:, 0] - motion(log.time + log.start_s + time[0])[0][:, 0]
    assert 0.5e-3 < np.std(error) < 1.1e-3


def test_a_rate_that_is_asked_for(tmp_path) -> None:
    time = np.arange(4000) / 2000.0
    (log,) = read(written(tmp_path, time), MAP.replace('column = "t"', 'column = "t"\nrate_hz = 500'))
    assert log.rate_hz == 500.0
    assert log.native_hz == 2000.0
    assert log.resampled
    np.testing.assert_allclose(log.q, motion(log.time + log.start_s)[0], atol=1e-5)
    with pytest.raises(InputError, match="rate_hz is 5000, but the log has 2000 samples a second"):
        read(written(tmp_path, time), MAP.replace('column = "t"', 'column = "t"\nrate_hz = 5000'))


def test_a_rate_that_changes_by_half(tmp_path) -> None:
    """As servos have it: 190 Hz while they are driven, 285 Hz when not."""
    time = np.concatenate([np.arange(400) / 190.0, 400 / 190.0 + np.arange(900) / 285.0])
    (log,) = read(written(tmp_path, time))
    assert log.rate_hz == pytest.approx(190.0, rel=0.02)
    assert log.usable.all()
    np.testing.assert_allclose(log.q, motion(log.time + log.start_s)[0], atol=2e-5)


def test_short_gaps_are_bridged_and_marked(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    kept = np.ones(1500, bool)
    kept[[300, 301, 302, 900]] = False
    (log,) = read(written(tmp_path, time[kept]))
    np.testing.assert_array_equal(~log.usable, ~kept)
    np.testing.assert_allclose(log.q, motion(time)[0], atol=1e-7)
    assert log.notes == ("4 of 1500 samples are bridged gaps and are left out.",)


def test_rows_that_lack_a_value_are_gaps(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    values = columns(time)
    values["knee.tau"][[40, 41]] = np.nan
    (log,) = read(write_csv(tmp_path / "log.csv", values))
    assert np.flatnonzero(~log.usable).tolist() == [40, 41]
    assert log.notes[0] == "2 rows lack a value (torque of knee first) and count as missing."


def test_long_gaps_cut_a_log(tmp_path) -> None:
    time = np.arange(5000) / 500.0
    kept = (time < 4) | ((time > 5) & (time < 5.3)) | (time > 7)
    one, two = read(written(tmp_path, time[kept]))
    assert one.name.endswith("log.csv (part 1)")
    assert two.start_s == pytest.approx(7.002)
    np.testing.assert_allclose(two.q, motion(two.time + two.start_s)[0], rtol=1e-9)
    assert "2 gaps of up to 1.7" in two.notes[0]
    assert "0.296 s are in none of them" in two.notes[0]


REFUSED = {
    "backwards": (
        lambda t: np.concatenate([t[:700], t[700:] - 0.5]),
        "time runs back by 0.498 s in row 700",
    ),
    "slow": (lambda t: t * 100, "at 5 Hz; 20 to 20000 Hz are allowed (is the unit of time right?)"),
    "fast": (lambda t: t / 100, "at 50000 Hz; 20 to 20000 Hz are allowed (is the unit of time right?)"),
    "scattered": (lambda t: t + 10 * np.floor(10 * t), "no part of it has samples for 1 s"),
    "one time": (lambda t: np.floor(t * 100) / 100, "at one time, in row 1"),
}


@pytest.mark.parametrize("case", list(REFUSED))
def test_stamps_that_cannot_be_used(tmp_path, case) -> None:
    change, said = REFUSED[case]
    time = np.arange(1500) / 500.0
    path = write_csv(tmp_path / "log.csv", columns(time) | {"t": change(time)})
    with pytest.raises(InputError) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)


def test_values_that_cannot_be_used(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    values = columns(time)
    values["hip.tau"][7] = np.inf
    with pytest.raises(InputError, match="torque of hip is inf in row 7"):
        read(write_csv(tmp_path / "log.csv", values))
    values["hip.tau"][:400] = np.nan
    with pytest.raises(InputError, match=r"torque of hip has no value in 26.7 % of the rows; at most 10 %"):
        read(write_csv(tmp_path / "log.csv", values))
    values["hip.tau"][:] = np.nan
    with pytest.raises(InputError, match="torque of hip has no value in any row"):
        read(write_csv(tmp_path / "log.csv", values))
    with pytest.raises(InputError, match="has 20 samples; at least 32"):
        read(written(tmp_path, time[:20]))
    with pytest.raises(InputError, match="no part of it has samples for 1 s"):
        read(written(tmp_path, time[:400]))
    with pytest.raises(InputError, match=r"missing column 'knee.vel' for dq of knee by map my.toml"):
        read(write_csv(tmp_path / "log.csv", {k: v for k, v in columns(time).items() if k != "knee.vel"}))
