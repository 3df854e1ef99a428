"""Input that could hang, fill the memory, reach the terminal or fail late: one sentence at once, or shown as it is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from command import refused, run
from discrepancy.joints.model import load_model
from estimator.errors import InputError
from estimator.recording.parquet import write_recording
from estimator.strict import read_json, read_toml
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.payload import load_payload
from recordings import small_recording

ESCAPE = "\x1b[31m"


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    """What hangs fails."""
    signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it hangs"))
    signal.alarm(60)
    yield
    signal.alarm(0)


@pytest.fixture
def pipe(tmp_path) -> Path:
    """Nobody ever writes into it."""
    os.mkfifo(tmp_path / "pipe.toml")
    return tmp_path / "pipe.toml"


def test_a_pipe_or_a_device_is_no_input(pipe, tmp_path, capsys):
    write_recording(small_recording(rows=150), tmp_path / "rec.parquet")
    for words in (
        ("estimate", "rec.parquet", "--config", pipe),
        ("diagnose", pipe),
        ("compare", pipe, pipe),
        ("inspect", "/dev/zero"),
        ("simulate", "--payload", pipe.rename(tmp_path / "pipe.xml"), "--out", tmp_path / "out.parquet"),
    ):
        os.mkfifo(pipe) if not pipe.exists() else None
        arguments = [tmp_path / word if word == "rec.parquet" else word for word in words]
        assert "regular file" in refused(capsys, *arguments), words
    for read in (read_toml, read_json):
        with pytest.raises(InputError, match="not a regular file"):
            read(pipe, "it")
    (tmp_path / "link.toml").symlink_to("/dev/zero")
    with pytest.raises(InputError, match=r"link\.toml"):
        read_map(tmp_path / "link.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 2_000 + "]" * 2_000, "recursion|levels"),
        ("a = " + "[" * 100 + "]" * 100, "more than 64 levels"),
        (".".join("a" * 50_000) + " = 1", "more than 64 parts"),
        ('[[ "x y" . ' + " . ".join(["b", "'c'"] * 40) + " ]]", "more than 64 parts"),
        ("a = 0x" + "f" * 20_000, "more than 4096 bits"),
        ("#" + "a" * (1 << 20), "larger than 1 MiB"),
    ],
)
def test_boundless_toml(tmp_path, text, said):
    file = tmp_path / "file.toml"
    file.write_text(text)
    begin = time.monotonic()
    for read in (read_map, lambda path: read_toml(path, "file")):
        with pytest.raises(InputError, match=said):
            read(file)
    assert time.monotonic() - begin < 10.0


@pytest.mark.parametrize(
    ("version", "said"),
    [
        ("*a9", "it has anchors"),
        ("0x" + "f" * 20_000, "more than 4096 bits"),
        ("[" * 50 + "]" * 50, r"version is \["),
    ],
)
def test_boundless_metadata_of_a_bag(tmp_path, version, said):
    bomb = "a0: &a0 [x]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10))
    head = bomb if version.startswith("*") else ""
    text = f"{head}rosbag2_bagfile_information:\n  version: {version}\n  storage_identifier: mcap\n"
    (tmp_path / "metadata.yaml").write_text(text)
    with pytest.raises(InputError, match=said):
        open_log(tmp_path)


BODY = '<body name="payload"><joint name="j"/><geom size=".1" mass="1"/></body>'


@pytest.mark.parametrize(
    ("before", "inside", "said"),
    [
        (
            '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>',
            "",
            "900,000,000 points",
        ),
        (
            '<asset><texture name="t" builtin="flat" width="99999" height="9999"/></asset>',
            "",
            "999,890,001 points",
        ),
        (
            "",
            '<replicate count="2000000000" offset="1 0 0"><site/></replicate>',
            "<replicate> makes|elements",
        ),
        ("", '<replicate count="999"><replicate count="999"><site/></replicate></replicate>', "elements"),
        ("", '<body><composite type="cable" count="9000 9000 1"/></body>', "elements"),
        ('<size nuserdata="2000000000"/>', "", "nuserdata of 2,000,000,000 entries"),
        (
            '<asset><mesh name="m" file="pipe.toml"/></asset>',
            "",
            r"pipe\.toml cannot be read \(not a regular file\)",
        ),
        ('<include file="pipe.toml"/>', "", r"pipe\.toml: cannot be read \(not a regular file\)"),
        ('<include file="model.xml"/>', "", r"includes model\.xml twice"),
        ("<a", "", "not well-formed XML"),
    ],
)
def test_boundless_models(pipe, tmp_path, before, inside, said):
    file = tmp_path / "model.xml"
    file.write_text(f"<mujoco>{before}<worldbody>{BODY}{inside}</worldbody></mujoco>")
    for read in (load_model, load_payload):
        with pytest.raises(InputError, match=said):
            read(file)
    file.write_text(f"<mujoco><worldbody>{BODY}</worldbody></mujoco>".replace('"j"', '"j&#10;OK"'))
    with pytest.raises(InputError, match="must have a printable name"):
        load_model(file)
    file.write_text(f"<mujoco><!-- a -- b --><worldbody>{BODY}</worldbody></mujoco>")
    assert load_model(file).joints == ("j",)


def test_a_height_field_in_a_picture_and_entities(tmp_path):
    size = (30_000).to_bytes(4, "big")
    (tmp_path / "h.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + 2 * size)
    file = tmp_path / "model.xml"
    file.write_text(
        f'<mujoco><asset><hfield name="h" file="h.png" size="1 1 1 1"/></asset><worldbody>{BODY}</worldbody></mujoco>'
    )
    with pytest.raises(InputError, match="900,000,000 pixels"):
        load_model(file)
    file.write_text('<!DOCTYPE m [<!ENTITY x SYSTEM "/etc/hostname">]><mujoco model="&x;"/>')
    for read in (load_model, load_payload):
        with pytest.raises(InputError, match="document type"):
            read(file)


def test_a_truth_that_cannot_be_read_is_told_before_the_work(tmp_path, capsys):
    write_recording(small_recording(rows=150), tmp_path / "rec.parquet")
    (tmp_path / "rec.truth.json").write_text("[" * 200_000)
    assert "rec.truth.json: not valid JSON" in refused(capsys, "diagnose", tmp_path / "rec.parquet")


def test_control_characters_are_shown_escaped(tmp_path, capsys, monkeypatch):
    shown = "\\x1b[31m"
    assert shown in refused(capsys, "inspect", tmp_path / f"{ESCAPE}.csv")
    monkeypatch.setattr("mocobot.commands.effects", lambda _: print(f"é {ESCAPE}\n\tx"))
    assert run(capsys, "effects") == (0, f"é {shown}\n\tx\n", "")
    file = tmp_path / "log.csv"
    file.write_text("time\u00a0[s],x\n" + "".join(f"{k / 100},{k}\n" for k in range(300)), encoding="utf-8")
    code, draft, _ = run(capsys, "map", file)
    assert (code, tomllib.loads(draft)["time"]["column"]) == (0, "time\u00a0[s]")


COMMAND = """
import sys, time, mocobot.cli
from pathlib import Path
from estimator.files import whole_folder
def run(_):
    with whole_folder(Path(sys.argv[1]), "x") as folder:
        (folder / "a").touch()
        print("ready", flush=True)
        time.sleep(60)
mocobot.cli._command = lambda _: run
mocobot.cli.main(["effects"])
"""
POOL = """
import os, sys, time
from joblib import Parallel, delayed
from estimator.files import ends_with_this
def work(_):
    os.write(1, f"{os.getpid()}\\n".encode())
    time.sleep(60)
Parallel(n_jobs=2, **ends_with_this())(delayed(work)(k) for k in range(2))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_command_that_is_told_to_end_clears_away_what_it_began(tmp_path, number):
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, tmp_path / "new" / "out"],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # a runner may have been told to ignore it
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        assert len(list((tmp_path / "new").iterdir())) == 1
        process.send_signal(number)
        assert process.wait(30) == 128 + number
    assert list(tmp_path.iterdir()) == []


def test_workers_end_with_a_parent_that_is_killed():
    process = subprocess.Popen([sys.executable, "-c", POOL], stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        workers = [int(process.stdout.readline()) for _ in range(2)]
        process.kill()
    until = time.monotonic() + 20.0
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < until, "workers go on"
        time.sleep(0.2)
