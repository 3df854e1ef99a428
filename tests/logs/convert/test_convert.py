"""``mocobot convert``: round trips to the last bit, logs in other units, at other rates and on other clocks."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from log_files import write_lerobot, write_text
from mocobot.cli import main
from mocobot_logs.convert import write_csv, write_npz
from omnid_design import DESIGN
from recorded_team import Sines, carry
from recordings import metadata, small_recording

FORMATS = ["log.csv", "log.npz", "log.parquet", "log.mcap", "log.db3", "bag"]


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short simulated trial."""
    path = tmp_path_factory.mktemp("trial") / "rec.parquet"
    main(["simulate", "--payload", "b", "--vias", "8", "--seed", "3", "--out", str(path)])
    return path


@pytest.fixture
def convert(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run the command; what it prints."""

    def run(*arguments: object) -> str:
        main(["convert", *(str(argument) for argument in arguments)])
        out, err = capsys.readouterr()
        assert err == ""
        return out

    return run


def assert_equal(a: Recording, b: Recording, tolerance: float = 0.0) -> None:
    for field in ("time", "phi", "theta", "tau", "ref"):
        x, y = getattr(a, field), getattr(b, field)
        assert (x is None) == (y is None)
        if x is not None:
            np.testing.assert_allclose(x, y, rtol=0.0, atol=tolerance)


# Round trips


@pytest.mark.parametrize("name", FORMATS)
def test_joint_level_comes_back_bit_by_bit(
    trial: Path, tmp_path: Path, convert: Callable[..., str], name: str
) -> None:
    log, back = tmp_path / name, tmp_path / "back.parquet"
    convert(trial, log)
    labels = ["--payload", "b"] if name == "log.csv" else []
    convert(log, back, *labels)
    original, read = read_recording(trial), read_recording(back)
    assert_equal(read, original)
    if name == "log.csv":  # has no place for what the trial says about itself
        assert read.metadata == replace(original.metadata, source="log log.csv", seed=None, control=None)
    else:
        assert read.metadata == original.metadata
        assert pq.read_table(back).equals(pq.read_table(trial))
    if name in ("log.csv", "log.mcap"):  # same bits, same estimate: for the others it goes without saying
        estimate, expected = (estimate_payload([replace(r, name="r")]).to_dict() for r in (read, original))
        assert estimate == expected
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "back.parquet"])


@pytest.mark.parametrize("name", FORMATS)
def test_wrist_level_comes_back_to_rounding(
    trial: Path, tmp_path: Path, convert: Callable[..., str], name: str
) -> None:
    log, back = tmp_path / name, tmp_path / "back.parquet"
    assert "wrist level" in convert(trial, log, "--level", "wrist")
    convert(log, back)  # at the level of the log
    read = read_recording(back)
    assert read.metadata.level == "wrist"
    assert_equal(read, read_recording(trial), 1e-12)
    if name != "log.npz":
        return
    convert(log, tmp_path / "joint.parquet", "--level", "joint")
    assert read_recording(tmp_path / "joint.parquet").metadata.level == "joint"
    assert_equal(read_recording(tmp_path / "joint.parquet"), read_recording(trial), 1e-12)


def test_files_say_what_they_hold(trial: Path, tmp_path: Path, convert: Callable[..., str]) -> None:
    """CSV and NPZ as other programs see them: numpy alone."""
    original = read_recording(trial)
    convert(trial, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open() as file:
        names = [name.strip('"\n') for name in file.readline().split(",")]
    table = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1)
    assert names == list(original.columns())
    assert np.array_equal(table[:, names.index("omnid2.tau3")], original.tau[:, 1, 2])
    convert(trial, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        assert np.array_equal(arrays["phi"], original.phi)
        assert np.array_equal(arrays["ref"], original.ref)
        assert str(arrays["mocobot"]) == original.metadata.to_json()


def test_arms_without_a_wrist_are_not_written(tmp_path: Path) -> None:
    """Driven angles at which the rods cannot meet: the sentence names the recording, and nothing is left."""
    recording = replace(small_recording(rows=20, ref=False), phi=np.full((20, 3, 3), -1.5), name="folded")
    for write in (write_csv, write_npz):
        with pytest.raises(InputError, match=r"^folded: "):
            write(recording, tmp_path / "log", "wrist")
    assert not list(tmp_path.iterdir())


# Logs of others


def signal(time: np.ndarray) -> dict[str, np.ndarray]:
    """Plausible smooth channels of three robots, a closed form in time: up to 4 Hz."""
    columns = {}
    for robot in (1, 2, 3):
        for k, name in enumerate(
            ("phi1", "phi2", "phi3", "theta_z", "theta_y", "theta_x", "tau1", "tau2", "tau3")
        ):
            middle, size = ((0.6, 0.05), (0.0, 0.1), (3.0, 2.0))[k // 3]
            rate = 2 * np.pi * (0.5 + 0.4 * k)
            columns[f"omnid{robot}.{name}"] = middle + size * np.sin(rate * time + robot)
    return columns


UNITS_MAP = """
version = 1
level = "joint"
trial = "periodic"
[time]
column = "t_ms"
unit = "ms"
[defaults]
column = "robot{robot0}/{channel}"
[channels]
phi1 = { unit = "counts", counts_per_turn = 1e6, offset = -1000 }
phi2 = { unit = "deg" }
phi3 = { unit = "deg" }
theta_z = { unit = "deg", sign = -1 }
theta_y = { unit = "rad" }
theta_x = { unit = "rad" }
tau1 = { unit = "mNm" }
tau2 = { unit = "mNm" }
tau3 = { unit = "mNm", sign = -1, offset = 20.0 }
[robot.2.channels.theta_z]
sign = 1
"""


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
def test_other_units_names_and_rates(tmp_path: Path, convert: Callable[..., str], rate_hz: float) -> None:
    """Written in odd units at another rate; the recording is the closed form at its own times."""
    time = np.arange(round(6 * rate_hz)) / rate_hz
    columns = {"t_ms": 1e3 * (1.7e9 + time)}
    raw_of = {
        "phi1": lambda x: x / (2 * np.pi) * 1e6 + 1000,
        "theta_y": lambda x: x,
        "theta_x": lambda x: x,
        "tau3": lambda x: -1e3 * x - 20.0,
    }
    for name, values in signal(time).items():
        robot, channel = int(name[5]), name[7:]
        usual = (lambda x: 1e3 * x) if channel.startswith("tau") else np.rad2deg
        flip = -1.0 if channel == "theta_z" and robot != 2 else 1.0
        columns[f"robot{robot - 1}/{channel}"] = flip * raw_of.get(channel, usual)(values)
    (tmp_path / "map.toml").write_text(UNITS_MAP)
    report = convert(
        write_text(tmp_path / "log.csv", columns, ";"),
        tmp_path / "rec.parquet",
        "--map",
        tmp_path / "map.toml",
    )
    recording = read_recording(tmp_path / "rec.parquet")
    assert recording.metadata.trial == "periodic"
    assert recording.metadata.design == DESIGN
    lead_s = (600 - len(recording.time)) / 2 / 100.0  # what the filter needs, at either end
    assert lead_s == 0.0 if rate_hz == 100.0 else 0.0 < lead_s < 0.15
    for name, expected in signal(recording.time + lead_s).items():
        read = recording.columns()[name]
        limit = 3e-5 if rate_hz > 100.0 else 1e-9  # the anti-alias filter's ripple
        np.testing.assert_allclose(read, expected, rtol=0.0, atol=limit, err_msg=name)
    assert ("low-passed and thinned" if lead_s else "taken as they are") in report


def turning(duration_s: float = 20.0) -> Recording:
    """Three robots that turn a payload: clocks can be told from it."""
    rng = np.random.default_rng(8)
    path = Sines.draw(rng, [0.06] * 3 + [0.01] * 3, 20, 0.1, 1.5)
    squeeze = Sines.draw(rng, [3.0] * 3, 3, 0.1, 0.5)
    return carry(path, squeeze, duration_s).recording


def test_clocks_are_reported_and_corrected_when_asked(tmp_path: Path, convert: Callable[..., str]) -> None:
    """Robot 2 is 12 ms ahead: each robot has a time column of its own."""
    recording = turning()
    columns = {f"t{i}": recording.time + 5.0 + 0.012 * (i == 2) for i in (1, 2, 3)}
    columns |= {name: values for name, values in recording.columns().items() if name != "time"}
    log = write_text(tmp_path / "log.csv", columns)
    values = (
        '[time]\ncolumn = "t{robot}"\nunit = "s"\n[defaults]\ncolumn = "omnid{robot}.{channel}"\n[channels]\n'
    )
    units = [("phi1", "rad"), ("phi2", "rad"), ("phi3", "rad"), ("theta_z", "rad"), ("theta_y", "rad")]
    units += [("theta_x", "rad"), ("tau1", "Nm"), ("tau2", "Nm"), ("tau3", "Nm")]
    lines = "".join(f'{name} = {{ unit = "{unit}" }}\n' for name, unit in units)
    (tmp_path / "map.toml").write_text(f'version = 1\nlevel = "joint"\n{values}{lines}')
    kept = convert(log, tmp_path / "kept.parquet", "--map", tmp_path / "map.toml")
    offsets = re.findall(r"robot (\d): offset ([-+][\d.]+) \+- ([\d.]+) ms", kept)
    assert [robot for robot, *_ in offsets] == ["2", "3"]
    assert float(offsets[0][1]) == pytest.approx(12.0, abs=0.05)
    assert float(offsets[1][1]) == pytest.approx(0.0, abs=0.05)
    assert "kept as logged (--clock correct takes them out)" in kept
    corrected = convert(
        log, tmp_path / "corrected.parquet", "--map", tmp_path / "map.toml", "--clock", "correct"
    )
    assert "    corrected\n" in corrected
    before, after = (read_recording(tmp_path / f"{name}.parquet") for name in ("kept", "corrected"))
    apart = {}
    for name, read in (("kept", before), ("corrected", after)):
        first = int(
            np.argmin(np.abs(recording.tau[:, 0] - read.tau[0, 0]).sum(axis=1))
        )  # robot 1 gives the time
        rows = slice(first + 100, first + len(read.time) - 100)
        apart[name] = np.max(np.abs(read.theta[100:-100, 1] - recording.theta[rows, 1]))
    assert apart["kept"] > 1e-3
    assert apart["corrected"] < 1e-5


def test_the_report_names_what_was_mended(tmp_path: Path, convert: Callable[..., str]) -> None:
    recording = turning(8.0)
    rows = np.delete(np.arange(800), [300, 301, 500])
    rows = np.insert(rows, 100, rows[100])
    columns = {name: values[rows] for name, values in recording.columns().items()}
    report = convert(write_text(tmp_path / "log.csv", columns), tmp_path / "rec.parquet", "--trial", "random")
    (row,) = re.findall(
        r"^    2 +(\d+) +([\d.]+) +(\S+), (\S+) +(\d+), (\d+) +(\d+) +(\d+)$", report, re.MULTILINE
    )
    samples, rate, _, _, gaps, longest_ms, filled, doubles = (float(x) for x in row)
    assert (samples, rate, gaps, longest_ms, filled, doubles) == (798, 100.0, 2, 20.0, 3, 1)
    assert len(read_recording(tmp_path / "rec.parquet").time) == 800


# Labels


def test_what_the_user_says_comes_first(tmp_path: Path, convert: Callable[..., str]) -> None:
    recording = replace(turning(6.0), metadata=metadata(payload="a", seed=5, trial="random"))
    log, back = tmp_path / "log.parquet", tmp_path / "back.parquet"
    write_recording(recording, log)
    design = tmp_path / "design.toml"
    text = (Path(__file__).parents[3] / "models" / "omnid" / "design.toml").read_text()
    design.write_text(re.sub(r"(?m)^rod_mass_kg\s*=.*$", "rod_mass_kg = 0.123", text))
    report = convert(log, back, "--trial", "static", "--payload", "π", "--design", design)
    read = read_recording(back).metadata
    assert (read.trial, read.payload, read.seed, read.source) == ("static", "π", 5, "test")
    assert read.design == replace(DESIGN, rod_mass_kg=0.123)
    assert "static trial, payload π" in report


def test_an_episode_of_a_lerobot_dataset(tmp_path: Path, convert: Callable[..., str]) -> None:
    recording = turning(8.0)
    dataset = write_lerobot(tmp_path / "set", [replace(recording, ref=None)] * 2)
    convert(dataset, tmp_path / "rec.parquet", "--episode", 1)
    read = read_recording(tmp_path / "rec.parquet")
    assert np.array_equal(read.tau, np.float32(recording.tau))
    assert np.array_equal(read.time, recording.time)


def test_other_rates_of_the_recording(tmp_path: Path, convert: Callable[..., str]) -> None:
    time = np.arange(6000) / 1000.0
    log = write_text(tmp_path / "log.csv", {"time": time} | signal(time))
    convert(log, tmp_path / "rec.parquet", "--rate", 250)
    read = read_recording(tmp_path / "rec.parquet")
    assert read.metadata.rate_hz == 250.0
    assert np.diff(read.time) == pytest.approx(0.004)
