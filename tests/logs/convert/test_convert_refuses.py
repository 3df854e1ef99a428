"""``mocobot convert`` on what it cannot use: one sentence, exit code 2, the target as it was and nothing beside it."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import command
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from log_files import write_lerobot, write_text
from mocobot_logs.bag.write import write_bag
from mocobot_logs.maps import builtin_map_text
from recordings import small_recording

Columns = dict[str, np.ndarray]
OUTPUTS = ["rec.parquet", "rec.csv", "rec.npz", "rec.mcap", "rec.db3", "bag"]
RECORDING = small_recording(rows=400, ref=False)


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """The sentence of a command that must fail and leave the folder as it was."""

    def run(*arguments: object) -> str:
        before = snapshot(tmp_path)
        err = command.refused(capsys, "convert", *arguments)
        assert snapshot(tmp_path) == before
        return err

    return run


def snapshot(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A good recording."""
    path = tmp_path / "log.parquet"
    write_recording(RECORDING, path)
    return path


# Samples


def columns() -> Columns:
    return dict(RECORDING.columns())


def change(name: str, edit: Callable[[np.ndarray], np.ndarray]) -> Callable[[Columns], Columns]:
    return lambda table: {
        n: edit(values.copy()) if n.startswith(name) else values for n, values in table.items()
    }


def rows(keep: np.ndarray) -> Callable[[Columns], Columns]:
    return lambda table: {name: values[keep] for name, values in table.items()}


def put(row: int | slice, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def edit(values: np.ndarray) -> np.ndarray:
        values[row] = value
        return values

    return edit


def ends_early(values: np.ndarray) -> np.ndarray:
    values[250:] = np.nan
    return values


def kept_at_random(share: float) -> np.ndarray:
    return np.sort(np.random.default_rng(2).choice(400, round(share * 400), replace=False))


SAMPLES: dict[str, tuple[Callable[[Columns], Columns], list[str]]] = {
    "zero rows": (rows(np.arange(0)), ["robot 1 has 0 samples; at least 16"]),
    "a few rows": (rows(np.arange(9)), ["robot 1 has 9 samples; at least 16"]),
    "NaN for too long": (
        change("omnid2.tau1", put(slice(77, 90), np.nan)),
        [
            "robot 2: no samples for 0.14 s",
            "NaN or that repeat the one before count as missing",
            "--split-at-gaps",
            "--crop",
        ],
    ),
    "infinity": (change("omnid3.phi2", put(77, np.inf)), ["robot 3", "phi2", "inf", "--drop"]),
    "time runs back": (change("time", put(100, 0.2)), ["robot 1", "time"]),
    "a stamp twice": (change("time", put(100, 0.99)), ["robot 1", "0.99"]),
    "a robot ends early": (change("omnid2", ends_early), ["robot 2 ends 1.5 s before", "--crop"]),
    "a robot is missing": (change("omnid2", lambda v: np.full_like(v, np.nan)), ["robot 2 has 0 samples"]),
    "30 % dropped": (rows(kept_at_random(0.7)), ["samples are missing", "at most 10 %"]),
    "a long gap": (
        rows(np.r_[0:100, 130:400]),
        ["no samples for 0.31 s", "at most 0.08 s", "--split-at-gaps"],
    ),
    "time in ms": (change("time", lambda t: 1e3 * t), ["10 s apart", "is the unit of time right?"]),
    "degrees": (
        change("omnid1.theta", np.rad2deg),
        ["column 'omnid1.theta_", "its range is", "rad"],
    ),
    "all in degrees": (
        lambda table: {n: v if n == "time" or "tau" in n else np.rad2deg(v) for n, v in table.items()},
        ["the values look like degrees"],
    ),
    "torque in mN m": (change("omnid3.tau", lambda v: 1e3 * v), ["column 'omnid3.tau", "torque_limit_Nm"]),
}


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_samples_that_are_no_trial(
    tmp_path: Path, refused: Callable[..., str], name: str, suffix: str
) -> None:
    edit, words = SAMPLES[name]
    bad = tmp_path / f"log.{suffix}"
    if suffix == "csv":
        write_text(bad, edit(columns()))
    else:
        np.savez(bad, **edit(columns()))  # type: ignore[arg-type]
    message = refused(bad, tmp_path / "rec.parquet")
    for word in [str(bad), *words]:
        assert word in message


def test_units_by_a_map(tmp_path: Path, refused: Callable[..., str]) -> None:
    """A unit that the map gets wrong shows in the samples; one that it cannot mean shows at once."""
    log_map = tmp_path / "map.toml"
    bad = write_text(tmp_path / "log.csv", columns())
    for old, new, words in (
        ('tau1 = { unit = "Nm" }', 'tau1 = { unit = "N" }', "channels.tau1: unit is 'N'"),
        ('[time]\nunit = "s"', '[time]\ncolumn = "time"\nunit = "us"', "is the unit of time right?"),
        ('[time]\nunit = "s"', '[time]\ncolumn = "clock"\nunit = "s"', "missing column 'clock' for time"),
        ("version = 1", "version = 1\nmode = 2", "unknown key 'mode'"),
        ('level = "joint"', "", "missing key 'level'"),
    ):
        text = builtin_map_text("mocobot").replace(old, new)
        assert text != builtin_map_text("mocobot")
        log_map.write_text(text)
        assert words in refused(bad, tmp_path / "rec.parquet", "--map", log_map)
    assert "the built-in maps are" in refused(bad, tmp_path / "rec.parquet", "--map", "omnid")


def test_wrist_positions_out_of_reach(tmp_path: Path, refused: Callable[..., str]) -> None:
    wrist = {
        name.replace("phi1", "h_x").replace("phi2", "h_y").replace("phi3", "h_z"): v
        for name, v in columns().items()
    }
    wrist = {
        name.replace("tau1", "force_x").replace("tau2", "force_y").replace("tau3", "force_z"): v
        for name, v in wrist.items()
    }
    message = refused(write_text(tmp_path / "log.csv", wrist), tmp_path / "rec.parquet")
    assert "cannot reach the wrist position" in message
    assert "are unit, sign and offset of the wrist's channels right?" in message


# Files


def truncated(path: Path, share: float = 0.6) -> Path:
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


def bomb(path: Path) -> Path:
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000,), }".ljust(117) + "\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "time.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()
        )
    return path


def text(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def bag(path: Path, recording: Recording = RECORDING) -> Path:
    write_bag(recording, path, storage="sqlite3" if path.suffix == ".db3" else "mcap")
    return path


def npz(path: Path) -> Path:
    np.savez(path, **columns())  # type: ignore[arg-type]
    return path


FILES: dict[str, tuple[Callable[[Path], Path], list[str]]] = {
    "missing": (lambda d: d / "none.csv", ["there is no such file"]),
    "empty folder": (lambda d: d, ["is a directory, and neither a rosbag2 bag nor a LeRobot dataset"]),
    "text named npz": (
        lambda d: text(d / "a.npz", "time,phi\n"),
        ["is named .npz, but does not begin like one"],
    ),
    "text named mcap": (lambda d: text(d / "a.mcap", "time,phi\n"), ["a.mcap"]),
    "binary named csv": (lambda d: text(d / "a.csv", bytes(range(256)) * 9), ["holds binary data"]),
    "unknown format": (lambda d: text(d / "a.h5", "HDF"), ["is of no known format", ".npz"]),
    "claim of 10 GB": (lambda d: bomb(d / "a.npz"), ["claims the shape (1250000000,)", "but has 0"]),
    "truncated csv": (
        lambda d: truncated(write_text(d / "a.csv", columns())),
        ["cells in line", "must have 28"],
    ),
    "truncated npz": (lambda d: truncated(npz(d / "a.npz")), ["damaged"]),
    "truncated mcap": (lambda d: truncated(bag(d / "a.mcap")), ["a.mcap"]),
    "truncated db3": (lambda d: truncated(bag(d / "a.db3")), ["a.db3"]),
    "ragged csv": (
        lambda d: text(d / "a.csv", "time,omnid1.phi1\n0,1\n1\n"),
        ["missing column 'omnid1.phi2'"],
    ),
    "several episodes": (
        lambda d: write_lerobot(d / "set", [RECORDING] * 2),
        ["holds 2 episodes", "--episode"],
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_no_logs(tmp_path: Path, refused: Callable[..., str], name: str) -> None:
    make, words = FILES[name]
    folder = tmp_path / "in"
    folder.mkdir()
    bad = make(folder)
    message = refused(bad, tmp_path / "rec.parquet")
    for word in [str(bad), *words]:
        assert word in message


def test_a_truncated_recording(tmp_path: Path, log: Path, refused: Callable[..., str]) -> None:
    assert "damaged one" in refused(truncated(log), tmp_path / "rec.parquet")


# Targets


def test_a_log_is_never_overwritten(tmp_path: Path, log: Path, refused: Callable[..., str]) -> None:
    link, folder = tmp_path / "link.parquet", bag(tmp_path / "bag")
    link.symlink_to(log)
    (inside,) = folder.glob("*.mcap")
    log_map = tmp_path / "map.csv"
    log_map.write_text(builtin_map_text("mocobot"))
    for source, target, options in (
        (log, log, []),
        (log, link, []),
        (link, log, []),
        (log, tmp_path / ".." / tmp_path.name / log.name, []),
        (folder, inside, []),
        (folder, folder, []),
        (folder, folder / "new.csv", []),
        (log, log_map, ["--map", log_map]),
    ):
        message = refused(source, target, *options)
        assert "; write somewhere else" in message
    assert "which would be lost; name another folder" in refused(inside, folder)


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("rec.txt", "the name must end in one of .parquet, .csv, .npz, .mcap, .db3, or have no suffix"),
        ("", "must end in one of"),
        ("/", "must end in one of"),
        ("file/bag", "file is a file)"),
        ("folder.csv", "is a folder; name the file to write"),
        ("folder.mcap", "is a folder; name the file to write"),
        ("log.parquet/rec.csv", "log.parquet is a file)"),
        ("x" * 300 + ".csv", "cannot be written"),
        ("file", "is a file; name a folder to write"),
        ("full", "exists and is not a bag of an earlier conversion; name a new folder"),
    ],
)
def test_targets_that_cannot_be(
    tmp_path: Path,
    log: Path,
    refused: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    target: str,
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("folder.csv", "folder.mcap", "full"):
        (tmp_path / folder).mkdir()
    (tmp_path / "full" / "something").write_text("")
    (tmp_path / "file").write_text("")
    assert words in refused(log, target)


@pytest.mark.slow
def test_a_full_disk(tmp_path: Path) -> None:
    """Files must not grow beyond 20 kB, which the system reports while they are written.

    Bytecode is not written here: CPython 3.11 keeps what fitted of a larger one, and later imports fail on it.
    """
    log, out = tmp_path / "log.parquet", tmp_path / "out"
    write_recording(RECORDING, log)
    out.mkdir()
    for name in OUTPUTS[:3]:
        (out / name).write_text("old")
    before = snapshot(out)
    code = (
        "import resource, sys\n"
        "from mocobot.cli import main\n"
        "sys.dont_write_bytecode = True\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "for target in sys.argv[2:]:\n"
        "    try:\n"
        "        main(['convert', sys.argv[1], target, '--force'])\n"
        "    except SystemExit as stop:\n"
        "        assert stop.code == 2\n"
    )
    targets = [str(out / name) for name in OUTPUTS]
    done = subprocess.run(
        [sys.executable, "-c", code, str(log), *targets], capture_output=True, text=True, check=True
    )
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == len(OUTPUTS)
    for line, target in zip(done.stderr.splitlines(), targets, strict=True):
        assert line.startswith(f"mocobot: {target}: cannot be written (")
    assert snapshot(out) == before


# Options


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--rate", "5"], "--rate is 5; it must be from 20 to 2000"),
        (["--rate", "nan"], "--rate is 'nan'; it must be a number"),
        (["--max-gap", "-1"], "--max-gap is -1; it must be from 0 to 10"),
        (["--episode", "0"], "is not a LeRobot dataset, so it has no episode 0"),
        (["--design", "none.toml"], "none.toml: not a readable design file"),
        (["--payload", "two\nlines"], "payload is 'two\\nlines'"),
        (["--map", "omnid-ros2"], "missing key 'column', by which tables are read"),
    ],
)
def test_options(
    tmp_path: Path, log: Path, refused: Callable[..., str], options: list[str], words: str
) -> None:
    assert words in refused(log, tmp_path / "rec.parquet", *options)


def test_clocks_that_cannot_be_told(tmp_path: Path, log: Path, refused: Callable[..., str]) -> None:
    """Noise turns no payload; without correction it is converted, and the report says that it is not known."""
    message = refused(log, tmp_path / "rec.parquet", "--clock", "correct")
    assert "the clock of robot 2 cannot be told from the motion" in message
