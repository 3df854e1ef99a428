"""Reading EMPS recordings: what is taken, what is refused and how, what is filled and left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.recording.preflight import checked, stuck
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.recording.whole import is_whole
from emps_made import GAIN, KP, KV, as_mat, reference, written
from estimator import inputs
from estimator.errors import InputError

RATE = 1000.0
MASS, COULOMB = 95.0, 20.0


def axis(name: str = "axis.mat") -> AxisLog:
    """A recording without a simulator: a carriage that follows its reference, and the force it takes."""
    x = reference()
    v = np.gradient(x, 1.0 / RATE)
    force = MASS * np.gradient(v, 1.0 / RATE) + COULOMB * np.sign(v)
    time = np.arange(len(x)) / RATE
    return AxisLog(name, time, x, x + 1e-4, force / GAIN, GAIN, KP, KV, np.ones(len(x), dtype=bool))


def refused(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        checked(read_emps(path))
    message = str(caught.value)
    assert path.name in message
    assert "\n" not in message
    return message


def test_a_recording_is_read_as_it_is(tmp_path: Path) -> None:
    made = axis()
    log = checked(read_emps(written(tmp_path, made)))
    np.testing.assert_allclose(log.time, made.time, atol=1e-12)
    for name in ("position", "reference", "voltage"):
        np.testing.assert_array_equal(getattr(log, name), getattr(made, name))
    assert (log.gain_N_per_V, log.kp_per_s, log.kv_Vs_per_m) == (GAIN, KP, KV)
    assert log.rate_hz == pytest.approx(RATE)
    assert log.notes == ()
    assert log.usable.all()


def test_rows_and_columns_and_other_variables_do_not_matter(tmp_path: Path) -> None:
    made = axis()
    flat = {k: np.ravel(v)[None, :] for k, v in as_mat(made).items()}
    path = tmp_path / made.name
    savemat(path, flat | {"pulses_N": np.array(["not", "a", "number"], dtype=object), "note": "mine"})
    np.testing.assert_array_equal(read_emps(path).position, made.position)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"qm": None}, ["lacks qm (measured position [m])", "t, qm, qg, vir, gtau, kp, kv"]),
        ({"qm": None, "kv": None}, ["lacks qm", "kv (velocity loop [V s/m])"]),
        ({"vir": np.zeros((7, 3))}, ["vir has shape 7 x 3", "vector"]),
        ({"vir": np.zeros((500, 1))}, ["different lengths", "vir 500"]),
        ({"kp": np.array([1.0, 2.0])}, ["kp has shape 1 x 2", "one number"]),
        ({"kp": -3.0}, ["kp is -3", "positive"]),
        ({"gtau": np.nan}, ["gtau is nan", "positive"]),
        ({"qg": "text"}, ["qg does not hold real numbers"]),
        ({"qm": 1j * np.ones((7200, 1))}, ["qm does not hold real numbers"]),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, change: dict, words: list[str]) -> None:
    message = refused(written(tmp_path, axis(), **change))
    for word in words:
        assert word in message


def test_a_number_that_is_not_finite_is_named(tmp_path: Path) -> None:
    qm = axis().position.copy()
    qm[[41, 50]] = np.nan, np.inf
    message = refused(written(tmp_path, axis(), qm=qm))
    assert "qm is nan in sample 42 and 1 more" in message


@pytest.mark.parametrize("content", [b"", b"not a mat file\n", b"PK\x03\x04 zip", bytes(200)])
def test_what_is_no_mat_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "some.mat"
    path.write_bytes(content)
    assert "MATLAB" in refused(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_cut_off_file_is_refused(tmp_path: Path, share: float) -> None:
    path = written(tmp_path, axis())
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    assert refused(path)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("bytes_left", [129, 200, 400, 4000])
def test_a_file_cut_off_inside_a_variable_does_not_reach_the_parser(
    tmp_path: Path, bytes_left: int, compressed: bool
) -> None:
    """On some such files scipy's crashes, the whole interpreter with it."""
    whole = tmp_path / "whole.mat"
    made = axis()
    savemat(whole, {"t": made.time, "qm": made.position, "gtau": GAIN}, do_compression=compressed)
    assert is_whole(whole)
    cut = tmp_path / "cut.mat"
    cut.write_bytes(whole.read_bytes()[:bytes_left])
    assert not is_whole(cut)
    assert "is cut off" in refused(cut)


def test_other_formats_are_left_to_the_parser(tmp_path: Path) -> None:
    old = tmp_path / "old.mat"
    savemat(old, {"t": np.arange(3.0)}, format="4")
    assert is_whole(old)
    (tmp_path / "short.mat").write_bytes(b"MATLAB")
    assert is_whole(tmp_path / "short.mat")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    assert "cannot be read" in refused(tmp_path / "none.mat")


# Stamps.


def with_stamps(folder: Path, keep: np.ndarray, time: np.ndarray | None = None) -> Path:
    made = axis()
    values = {k: np.ravel(v)[keep] for k, v in as_mat(made).items() if np.size(v) > 1}
    return written(folder, made, **(values if time is None else values | {"t": time}))


def test_missing_samples_are_filled_and_said(tmp_path: Path) -> None:
    made = axis()
    keep = np.ones(len(made.time), dtype=bool)
    keep[[100, 101, 102, 2000, 3001]] = False
    log = read_emps(with_stamps(tmp_path, keep))
    np.testing.assert_allclose(log.time, made.time, atol=1e-9)
    np.testing.assert_allclose(log.position, made.position, atol=2e-6)
    (note,) = log.notes
    assert "5 of 7200 samples are missing (longest gap 4 ms)" in note


def test_jitter_far_below_a_period_is_no_matter(tmp_path: Path) -> None:
    made = axis()
    time = made.time + 2e-5 * np.random.default_rng(0).uniform(-1, 1, len(made.time))
    log = read_emps(with_stamps(tmp_path, np.ones(len(time), dtype=bool), np.sort(time)))
    np.testing.assert_allclose(np.diff(log.time), 1e-3, rtol=1e-4)


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        (lambda t: np.where(np.arange(len(t)) == 70, t[69], t), "must increase"),
        (lambda t: t[::-1].copy(), "must increase"),
        (lambda t: t + 4e-4 * (np.arange(len(t)) % 2), "t is not even"),
        (lambda t: np.where(t > 3.0, t + 0.1, t), "0.101 s are missing from t = 3 s on"),
        (lambda t: 6.0 * t, "166.7 samples a second"),
        (lambda t: t / 3.0, "2.4 s long"),
    ],
    ids=["twice", "backwards", "uneven", "gap", "slow", "short"],
)
def test_stamps_that_cannot_be_used_are_refused(tmp_path: Path, stamps, words: str) -> None:
    made = axis()
    message = refused(with_stamps(tmp_path, np.ones(len(made.time), dtype=bool), stamps(made.time)))
    assert words in message


# Preflight.


def test_a_stuck_reading_is_bridged_and_left_out(tmp_path: Path) -> None:
    made = axis()
    qm = made.position.copy()
    qm[2000:2400] = qm[2000]
    log = checked(read_emps(written(tmp_path, made, qm=qm)))
    assert not log.usable[2001:2400].any()
    assert log.usable[:2000].all()
    assert log.usable[2400:].all()
    np.testing.assert_allclose(log.position, made.position, atol=1e-9)  # the tracking error was constant
    assert "qm is stuck at" in log.notes[0]
    assert "from 2.000 to 2.399 s" in log.notes[0]


def test_rest_on_command_is_not_stuck() -> None:
    made = axis()
    made.position[1000:1500] = made.position[1000]
    made.reference[1000:1500] = made.reference[1000]
    assert stuck(made) == []


def test_a_reading_that_is_stuck_for_long_is_refused(tmp_path: Path) -> None:
    qm = axis().position.copy()
    qm[1000:4000] = qm[1000]
    assert "stuck for 42 % of the time" in refused(written(tmp_path, axis(), qm=qm))


@pytest.mark.parametrize("name", ["vir", "qm"])
def test_a_wrong_sign_is_refused(tmp_path: Path, name: str) -> None:
    values = as_mat(axis())[name]
    message = refused(written(tmp_path, axis(), **{name: -np.asarray(values)}))
    assert "drives the axis backwards" in message
    assert "mass of -9" in message


def test_an_axis_that_does_not_move_is_refused(tmp_path: Path) -> None:
    message = refused(written(tmp_path, axis(), qm=1e-5 * axis().position))
    assert "at least 1 mm" in message


@pytest.mark.parametrize("step", [1e-5, 6.1e-5, 1e-3 / 3])
def test_resolution_is_read_off(step: float) -> None:
    made = axis()
    read = replace(made, position=np.round(made.position / step) * step)
    assert read.step_m == pytest.approx(step, rel=1e-6)


def test_rounding_hides_neither_steps_nor_a_stuck_reading() -> None:
    """A log of twelve digits."""
    made = axis()
    position = np.round(made.position / 1e-6) * 1e-6
    position[1000:1500] = position[1000]
    position *= 1.0 + 1e-12 * np.random.default_rng(0).standard_normal(len(position))
    log = replace(made, position=position)
    assert log.step_m == pytest.approx(1e-6, rel=1e-6)
    ((start, stop),) = stuck(log)
    assert (start, stop) == pytest.approx((1000, 1500), abs=2)


def test_a_smooth_position_has_no_steps() -> None:
    made = axis()
    noise = 1e-9 * np.random.default_rng(0).standard_normal(7200)
    assert replace(made, position=made.position + noise).step_m == 0.0


def test_a_coarse_position_and_saturation_are_said(tmp_path: Path) -> None:
    made = axis()
    step = 2e-5
    volts = made.voltage.copy()
    volts[500:510] = 10.0
    log = checked(read_emps(written(tmp_path, made, qm=np.round(made.position / step) * step, vir=volts)))
    assert any("steps of 20 um" in note for note in log.notes)
    assert any("saturates (+-10 V) in 10 of 7200 samples" in note for note in log.notes)
    assert log.saturated.sum() == 10


def test_rows_that_repeat_count_once(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    made = axis()
    made = replace(made, voltage=made.voltage + rng.normal(0.0, 0.01, len(made.time)))
    whole = read_emps(written(tmp_path, made))
    assert whole.notes == ()
    index = np.arange(len(made.time))
    index[2000:2010] = 2000
    fields = {name: getattr(made, name)[index] for name in ("position", "reference", "voltage")}
    log = read_emps(written(tmp_path, replace(made, **fields)))
    assert log.notes[0] == "9 rows repeat the one before, and a reading counts once."
    assert "9 of" in log.notes[1]
    np.testing.assert_allclose(log.position, whole.position, atol=1e-5)
    index[2000:4000] = 2000
    fields = {name: getattr(made, name)[index] for name in ("position", "reference", "voltage")}
    assert "s are missing from t = 2 s on" in refused(written(tmp_path, replace(made, **fields)))


def test_a_file_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "axis.mat"
    savemat(path, as_mat(axis()) | {"more": np.zeros(1 << 18)}, do_compression=True)
    assert len(read_emps(path).time)
    monkeypatch.setattr(inputs, "FREE_BYTES", 1 << 20)
    monkeypatch.setattr(inputs, "LARGEST_RATIO", 2)
    assert "axis.mat: unpacks to at least 0.00" in refused(path)
