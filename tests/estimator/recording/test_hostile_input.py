"""Input that hurts: targets, bombs, interrupted runs, numbers beyond arithmetic."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.files import write_text
from estimator.inputs import set_max_unpacked
from estimator.recording.checks import check_recording
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.recording.parquet import METADATA_KEY, read_recording, write_recording
from estimator.signals import process_recording
from mocobot.cli import main
from omnid_design import DESIGN
from recordings import metadata, small_recording


def resting(rows: int = 1500, **changes) -> Recording:
    """Three robots that hold something still: a mass, and nothing else, can be had from it."""
    recording = small_recording(rows, ref=False, **changes)
    shape = recording.phi.shape
    tau = 4.0 + 1e-6 * recording.tau  # equal rows would be one reading
    return dataclasses.replace(recording, phi=np.full(shape, 0.6), theta=np.zeros(shape), tau=tau)


def turning() -> Recording:
    """One robot that turns and lifts something."""
    recording = resting(robots=1)
    time = recording.time[:, None, None]
    return dataclasses.replace(recording, theta=0.1 * np.sin(time * np.array([3.0, 4.0, 5.0])))


@pytest.fixture
def rec(tmp_path: Path) -> Path:
    path = tmp_path / "rec.parquet"
    write_recording(resting(), path)
    return path


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """All of standard error, which must be one sentence, of a command that must exit with 2."""
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert (stop.value.code, out) == (2, "")
    assert err.startswith("mocobot: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert "\r" not in err
    return err


def test_targets_that_cannot_be_written(
    rec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for target, words in (
        ("", "folder"),
        ("/", "folder"),
        ("..", "folder"),
        (tmp_path, "folder"),
        (rec / "est.json", "rec.parquet is a file)"),
        ("/dev/null", "not a regular file"),
        ("x" * 300, "cannot be written"),
    ):
        assert words in refusal(capsys, "estimate", rec, "--out", target)
        assert [path.name for path in tmp_path.iterdir()] == [rec.name]
    assert "folder" in refusal(capsys, "simulate", "--out", _folder(tmp_path / "d.parquet"))


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_interrupted_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(self: Path, target: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text(tmp_path / "est.json", "{}")
    assert not list(tmp_path.iterdir())


def test_a_recording_is_never_overwritten(
    rec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = rec.read_bytes()
    link = tmp_path / "link.json"
    link.symlink_to(rec)
    for target in (rec, tmp_path / ".." / tmp_path.name / rec.name, link):
        assert "is an input" in refusal(capsys, "estimate", rec, "--out", target, "--force")
        assert rec.read_bytes() == before


@pytest.mark.parametrize("cutoff_hz", ["0", "-1", "60", "1e-6", "0.4"])
def test_cutoffs_that_make_no_sense(rec: Path, capsys: pytest.CaptureFixture[str], cutoff_hz: str) -> None:
    assert "--cutoff-hz is" in refusal(capsys, "estimate", rec, "--cutoff-hz", cutoff_hz)


def test_cutoff_goes_with_the_trimmed_ends() -> None:
    recording = resting()
    with pytest.raises(InputError, match=r"cutoff_hz is 0.9; .* at least 1 Hz"):
        process_recording(recording, cutoff_hz=0.9, trim_s=1.0)
    assert process_recording(recording, cutoff_hz=1.0, trim_s=1.0).samples == 1300
    assert process_recording(recording, cutoff_hz=0.9, trim_s=0.0).samples == 1500


def test_torques_in_another_unit() -> None:
    good = small_recording()
    for scale in (1e3, 1e200):
        bad = dataclasses.replace(good, tau=scale * good.tau, name="trial.parquet")
        with pytest.raises(InputError, match=r"trial.parquet: column 'omnid1.tau1' reaches .* N m"):
            check_recording(bad)
    limit = DESIGN.torque_limit_Nm
    check_recording(dataclasses.replace(good, tau=np.full_like(good.tau, -2 * limit)))


@pytest.mark.parametrize(
    ("recording", "change"),
    [(turning(), {"gravity_mps2": 1e-300}), (resting(), {"rod_mass_kg": 1e308})],
)
def test_design_beyond_arithmetic(recording: Recording, change: dict[str, float]) -> None:
    design = dataclasses.replace(DESIGN, **change)
    odd = dataclasses.replace(recording, metadata=dataclasses.replace(recording.metadata, design=design))
    with pytest.raises(InputError, match="cannot be solved"):
        estimate_payload([odd])


def test_interrupted_before_anything_ran(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tyro.cli", interrupt)
    with pytest.raises(SystemExit) as stop:
        main(["estimate"])
    assert stop.value.code == 130
    assert capsys.readouterr().err == "mocobot: interrupted\n"


def test_labels_are_printable() -> None:
    values = json.loads(metadata(payload="a").to_json())
    for label in ("\ud800", "\x1b[31mred", "two\nlines", "nul\0"):
        with pytest.raises(InputError, match=r"payload is .*; it must be text or null, all of it printable"):
            RecordingMetadata.from_json(json.dumps({**values, "payload": label}))
    assert RecordingMetadata.from_json(json.dumps({**values, "payload": "Träger 1"})).payload == "Träger 1"


def test_output_that_cannot_take_the_text(tmp_path: Path) -> None:
    rec = tmp_path / "rec.parquet"
    write_recording(resting(payload="Träger"), rec)
    command = [sys.executable, "-m", "mocobot", "estimate", str(rec)]
    ascii_only = {"PYTHONIOENCODING": "ascii", "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, capture_output=True, check=False, env=ascii_only)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"(Tr\xe4ger)" in done.stdout
    closed = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert closed.stdout is not None
    closed.stdout.close()
    assert closed.stderr is not None
    assert closed.stderr.read() == b""
    closed.stderr.close()
    assert closed.wait() == 141


LIMIT = """
import atexit, re, resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))  # libraries reserve more than they use
status = Path("/proc/self/status")  # of Linux; what getrusage tells there includes the parent before it ran this
peak = lambda: re.search(r"VmHWM:\\s*(\\d+)", status.read_text())[1] if status.is_file() else 0
atexit.register(lambda: print(peak()))
from mocobot.cli import main
main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def bomb(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 30 million rows of zeros, 8.7 GiB, in 5 MB."""
    path = tmp_path_factory.mktemp("bomb") / "rec.parquet"
    recording, zeros = small_recording(rows=10), np.zeros(1 << 20)
    names, text = ["time", *recording.columns()], recording.metadata.to_json().encode()
    block = pa.table({name: zeros for name in dict.fromkeys(names)}).replace_schema_metadata(
        {METADATA_KEY: text}
    )
    with pq.ParquetWriter(path, block.schema) as writer:
        for _ in range(30):
            writer.write_table(block)
    return path


@pytest.mark.parametrize("command", ["estimate", "inspect", "replay --save a.rrd", "diagnose"])
def test_a_bomb_is_refused_in_bounded_memory(bomb: Path, command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMIT, *command.split(), str(bomb)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"mocobot: {bomb}: unpacks to at least 8.67")
    assert "GiB, which --max-unpacked GIB changes" in done.stderr
    assert int(done.stdout.split()[-1]) < 1 << 20  # KiB in use at the peak


def test_the_option_changes_the_limit(bomb: Path, tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "mocobot", "inspect", str(bomb), "--max-unpacked"]
    done = subprocess.run([*arguments, "0.5"], capture_output=True, text=True, timeout=60, check=False)
    assert "the limit is 0.5 GiB" in done.stderr
    done = subprocess.run([*arguments, "-1"], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr == "mocobot: --max-unpacked is -1; it must be above 0 and at most 1e6 GiB\n"
    write_recording(small_recording(rows=50), path := tmp_path / "small.parquet")
    set_max_unpacked(1e-9)
    try:
        assert len(read_recording(path).time) == 50  # never below a file's own size
    finally:
        set_max_unpacked(None)
