"""What somebody does wrong on the first day: every command, one sentence each, exit code 2, and nothing written."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from command import refused
from diagnosed import small_diagnosis
from estimator.files import list_written, write_json
from estimator.recording.parquet import write_recording
from log_files import write_text
from mocobot_logs.bag.write import write_bag
from recordings import small_recording

LOGS = "a rosbag2 folder, .mcap or .db3, a CSV file (.csv, .tsv, .txt), an .npz archive, a MATLAB file (.mat), a .parquet file or a LeRobot dataset"  # noqa: E501
RESULTS = "paper.json of `mocobot paper --out`, diagnosis.json of `mocobot diagnose --out`, calibration.json of `mocobot calibrate --out`, campaign.json of `mocobot campaign --out`, or JSON files of `mocobot estimate --out`"  # noqa: E501
FORCE = "exists; give --force to replace it, or name another file"
INSIDE = "cannot be written (.../rec.parquet is a file)"
PAYLOADS, PRESETS = (
    "the payloads are a, b, c, d, flexible, folding, hinged, sliding",
    "the presets are ideal, nominal, uncalibrated",
)

WORDS = {
    "": "no command given; it must be one of example, inspect, map, convert, ...",
    "estimat rec.parquet": "there is no command 'estimat'; did you mean 'estimate'?",
    "rec.parquet": "there is no command 'rec.parquet'; the commands are example, inspect, map, convert, ...",
    "--colour red": "the command line has no option --colour; see mocobot --help",
    "estimate rec.parquet --metod joint": "estimate has no option --metod; did you mean --method?",
    "estimate rec.parquet --rec rec.parquet": "estimate has no option --rec; see mocobot estimate --help",
    "estimate rec.parquet --out": "--out EST.json needs a value; see mocobot estimate --help",
    "simulate": "--out must be given: REC.parquet, or with --trials a folder; see mocobot simulate --help",
    "simulate --out-dir new": "new: the file's name must end in .parquet",
    "simulate --out new.parquet --out-dir new": "--out and --out-dir are two names of one option; give one of them",
    "simulate --out new.parquet --trials static": "--out is new.parquet; with --trials it must be a folder",
    "simulate --arms 0": "simulate has no option --arms; see mocobot simulate --help",
    "simulate --efect joint_friction --out new.parquet": "simulate has no option --efect; did you mean --effect?",
    "effects rust": "effect 'rust' does not exist; the effects are phi_zero, theta_zero, ...",
    "effects joint_fricton": "effect 'joint_fricton' does not exist; did you mean 'joint_friction'?",
    "convert": "IN and OUT must be given; see mocobot convert --help",
    "convert log.csv": "OUT must be given; see mocobot convert --help",
    "inspect": "LOG must be given; see mocobot inspect --help",
    "inspect log.csv rec.parquet": "inspect has no use for 'rec.parquet' there; see mocobot inspect --help",
    "report": "DIR must be given; see mocobot report --help",
    "paper now": "paper has no use for 'now' there; see mocobot paper --help",
    "replay rec.parquet --web yes": "replay has no use for 'yes' there; see mocobot replay --help",
}  # fmt: skip
"""Command lines that are none."""

SIMULATE = {
    "--payload z": f"payload 'z' does not exist; {PAYLOADS}",
    "--payload ''": f"payload '' does not exist; {PAYLOADS}",
    "--payload none.xml": "none.xml: not a readable MJCF (No such file or directory)",
    "--payload half.xml": "half.xml: not a readable MJCF or URDF, it is not well-formed XML (no element found: ...)",
    "--preset Nominal": f"preset 'Nominal' does not exist; {PRESETS}",
    "--trajectory circle": "--trajectory is 'circle'; it must be one of random, periodic, static, free",
    "--vias 0": "--vias is 0; it must be at least 1",
    "--vias nan": "--vias is 'nan'; it must be a whole number",
    "--vias 100000000": "--vias is 100000000; that many could last longer than 3600 s",
    "--vias 3 --trajectory static": "--vias is for a random or free trajectory; this one is static",
    "--duration 10": "--duration is for a periodic trajectory; this one is random",
    "--trajectory periodic --duration -1": "duration is -1.0 s; it must be at least 4 s and at most 3600 s",
    "--trajectory periodic --duration inf": "--duration is 'inf'; it must be a number",
    "--robots 3": "--robots is for a free trajectory; this one is random",
    "--trajectory free --duration 9": "--duration is for a periodic trajectory; this one is free",
    "--trajectory free --robots 0": "--robots is 0; it must be at least 1 and at most 100",
    "--trajectory free --robots 101": "--robots is 101; it must be at least 1 and at most 100",
    "--trajectory free --model folder": "model folder carries a payload; robots of a free trial hold nothing",
    "--seed -1": "--seed is -1; it must be at least 0",
    "--effect rust": "effect 'rust' does not exist; the effects are phi_zero, theta_zero, ...",
    "--effect joint_fricton:robot=2": "effect 'joint_fricton' does not exist; did you mean 'joint_friction'?",
    "--effect drag:c=1": "effect 'drag:c=1': there is no 'c'; drag takes coefficient, turning, quadratic, ...",
    "--effect drag:coefficient=1e4": "drag: coefficient_Ns_per_m is 10000.0; it must be a finite number ...",
    "--effect phi_zero:robot=4,joint=1,zero=0.1": "phi_zero: robot is 4; the team has robots 1 .. 3",
    "--effect push:trial=2,start=1,duration=1,force_x=5": "push: trial is 2; the trials are 1 .. 1",
    "--trajectory free --effect drag:coefficient=1": "drag: acts on a payload; robots of a free trial hold nothing",
    "--units none.json": "none.json: there is no such file; it would be a team's units",
    "--units lone.truth.json": "lone.truth.json: missing key 'as_built'; required are as_built",
    "--units lone.truth.json --model .": "--units and --model are both given; the model has robots of its own, ...",
    "--model none": "none/effects.json: cannot be read (No such file or directory); an extended model has this file",
    "--model . --payload a": "--payload and --model are both given; the model has its own payload, so leave one out",
}
"""Options of ``simulate``."""

PAPER = {
    "--payload a x": "payload 'x' does not exist; the payloads are a, b, c, d",
    "--payload hinged": "payload 'hinged' has two bodies; the payloads are a, b, c, d",
    "--payload a b a": "--payload is 'a b a'; give each once",
    "--payload": "no payload given; name at least one",
    "--preset perfect": f"preset 'perfect' does not exist; {PRESETS}",
    "--trials 0": "--trials is 0; it must be at least 1",
    "--seed -1": "--seed is -1; it must be at least 0",
    "--jobs 0": "--jobs is 0; it must be at least 1",
    "--recordings": "--recordings needs --out",
}
"""Options of ``paper``."""

OPTIONS = {
    "estimate": "no recording given; name at least one file",
    "estimate rec.parquet ./rec.parquet": "rec.parquet is given twice, and would count twice",
    "estimate rec.parquet --cutoff-hz 0": "--cutoff-hz is 0.0; it must lie between 0 and 50 Hz",
    "estimate rec.parquet --cutoff-hz nan": "--cutoff-hz is 'nan'; it must be a number",
    "estimate rec.parquet --method best": "--method is 'best'; it must be one of auto, fit, staged, joint",
    "diagnose": "no recording given; name at least one file",
    "diagnose --exclude push rec.parquet": "no recording given; name them before --exclude",
    "diagnose rec.parquet --exclude ghost": "cause 'ghost' does not exist; the causes are phi_zero, theta_zero, ...",
    "diagnose rec.parquet --jobs 0": "--jobs is 0; it must be at least 1",
    "diagnose rec.parquet --tolerances none.toml":
        "none.toml: not a readable file of tolerances (No such file or directory)",
    "convert log.csv new.parquet --rate 1000":
        "log.csv: robot 1: samples come 0.01 s apart, at 100 Hz; for a recording of 1000 Hz 250 to 20000 Hz are "
        "needed, so this log allows a rate of at most 400 Hz",
    "convert log.csv new.parquet --max-gap 50ms": "--max-gap is '50ms'; it must be a number",
    "convert log.csv new.parquet --crop 1-2":
        "--crop is '1-2'; it must be FROM:TO in seconds from the log's start, such as 12:95, 12: or :95",
    "convert log.csv new.parquet --crop": "--crop FROM:TO needs a value; see mocobot convert --help",
    "convert log.csv new.parquet --drop 2:1-2":
        "--drop is '2:1-2'; it must be robot=N:FROM-TO in seconds from the log's start, such as robot=2:30-31",
    "convert log.csv new.parquet --drop robot=4:1-2":
        "log.csv: --drop robot=4:1-2: there is no robot 4; robots are counted from 1 to 3",
    "convert log.csv new.parquet --split-at-gaps":
        "log.csv: no part of it has all robots' samples for 9.5 s without a gap of more than 0.08 s; ...",
    "convert log.csv rec.parquet --crop 1:2": f"rec.parquet: {FORCE}",
    "estimate rec.parquet --map mocobot": "map mocobot: all files are recordings, which need none; leave the map out",
    "map": "LOG must be given; see mocobot map --help",
    "map log.csv --out page.html": f"page.html: {FORCE}",
    "map log.h5": f"log.h5: is of no known format; a log is {LOGS}",
    "convert log.csv new.parquet --map none.toml":
        "map none.toml: there is no such file, and the built-in maps are omnid-ros2, ...",
    "convert log.csv new.parquet --map empty.toml": "map empty.toml: missing key 'version'; ...",
    "convert log.csv new.parquet --design empty.toml": "empty.toml: missing key 'base_radius_m'; the keys are ...",
    "convert log.csv new.h5":
        "new.h5: the name must end in one of .parquet, .csv, .npz, .mcap, .db3, or have no suffix (a bag's folder)",
    "inspect rec.parquet --map nonsense":
        "map nonsense: there is no such file, and the built-in maps are omnid-ros2, ...",
    "inspect rec.parquet --design none.toml": "none.toml: not a readable design file (No such file or directory)",
    "inspect rec.parquet --episode 3": "rec.parquet: is not a LeRobot dataset, so it has no episode 3",
    "replay --save new.rrd": "no recording given; name at least one file",
    "replay rec.parquet": "there is no display to open the viewer on; write a file with --out replay.rrd, or ...",
    "replay rec.parquet --save new.rrd --web": "--save and --web are both given; choose a file or a browser",
    "replay rec.parquet --save new.mp4": "new.mp4: the file's name must end in .rrd",
    "replay rec.parquet --save new.rrd --payload z": f"payload 'z' does not exist; {PAYLOADS}",
    "replay rec.parquet --save new.rrd --payload none.xml":
        "none.xml: not a readable MJCF (No such file or directory)",
    "replay rec.parquet --save new.rrd --estimate empty.json": "empty.json: not valid JSON (...",
    "replay rec.parquet --save new.rrd --diagnosis folder":
        "folder/diagnosis.json: there is no such file; it would be a diagnosis",
    "replay rec.parquet --save new.rrd --truth":
        "rec.truth.json: there is no such file; it would be the truth beside a simulated recording",
    "report folder": f"folder: holds no result of mocobot; a report is made of {RESULTS}",
    "report none": f"none: there is no such folder; it must hold {RESULTS}",
    "report empty.json": "empty.json: is a file; name the folder that holds it",
    "report rec.parquet":
        "rec.parquet: is a file; name a folder of results, such as mocobot estimate --out results/est.json makes",
    "report verdict --out new.txt": "new.txt: the file's name must end in .html",
}  # fmt: skip
"""Options of the other commands."""

OUTPUTS = {
    "simulate --out old.parquet": f"old.parquet: {FORCE}",
    "simulate --out lone.parquet": f"lone.truth.json: {FORCE}",
    "simulate --out half.xml": "half.xml: the file's name must end in .parquet",
    "simulate --out folder": "folder: is a folder; name the file to write",
    "simulate --out rec.parquet/new.parquet": f"rec.parquet/new.parquet: {INSIDE}",
    "simulate --out /proc/new/new.parquet": "/proc/new/new.parquet: cannot be written (...)",
    "paper --out rec.parquet": "rec.parquet: is a file; name a folder to write",
    "paper --out bag": "bag: exists and is not an earlier experiment; name a new folder",
    "paper --out paper": "paper: is an earlier experiment; give --force to replace it, or name a new folder",
    "paper --out .": ".: is the current folder, or above it; name a folder of its own",
    "paper --out /proc/new": "/proc/new: cannot be written (...)",
    "estimate none.parquet --out log.csv": f"log.csv: {FORCE}",
    "estimate rec.parquet --force --out rec.parquet": "rec.parquet: is an input; write somewhere else",
    "estimate none.parquet --out folder": "folder: is a folder; name the file to write",
    "estimate none.parquet --out /dev/null": "/dev/null: is not a regular file; name another one to write",
    "diagnose none.parquet --out log.csv": "log.csv: is a file; name a folder to write",
    "diagnose none.parquet --force --out bag": "bag: exists and is not an earlier diagnosis; name a new folder",
    "diagnose none.parquet --out verdict":
        "verdict: is an earlier diagnosis; give --force to replace it, or name a new folder",
    "diagnose none.parquet --force --out folder/..":
        "folder/..: is the current folder, or above it; name a folder of its own",
    "diagnose verdict/none.parquet --force --out verdict":
        "verdict: holds verdict/none.parquet, which would be lost; name another folder",
    "diagnose none.parquet --out rec.parquet/new": f"rec.parquet/new: {INSIDE}",
    "convert none.csv rec.parquet": f"rec.parquet: {FORCE}",
    "convert log.csv log.csv --force": "log.csv: is an input; write somewhere else",
    "convert bag bag/new.csv --force": "bag/new.csv: lies in the input bag; write somewhere else",
    "convert none.csv bag":
        "bag: is a bag of an earlier conversion; give --force to replace it, or name a new folder",
    "convert none.csv paper --force": "paper: exists and is not a bag of an earlier conversion; name a new folder",
    "convert none.csv bag --force": "none.csv: there is no such file",
    "convert bag bag --force": "bag: is an input; write somewhere else",
    "inspect none.parquet --json log.csv": f"log.csv: {FORCE}",
    "inspect rec.parquet --json rec.parquet --force": "rec.parquet: is an input; write somewhere else",
    "replay none.parquet --save old.rrd": f"old.rrd: {FORCE}",
    "report verdict --out page.html": f"page.html: {FORCE}",
    "report verdict --out verdict": "verdict: is a folder; name the file to write",
}  # fmt: skip
"""Outputs that may not be written, or cannot; inputs that are missing show that these are not looked at before."""

FILES = {
    "none.parquet": "none.parquet: there is no such file",
    "empty.parquet": "empty.parquet: not a readable Parquet file, or a damaged one (Parquet file size is 0 bytes)",
    "cut.parquet": "cut.parquet: not a readable Parquet file, or a damaged one (...)",
    "text.parquet": "text.parquet: not a readable Parquet file, or a damaged one (...)",
    "folder": "folder: is a directory; it must be a recording file",
    "'my log.txt'": "my log.txt: missing column 'omnid1.phi1' for phi1 of robot 1 by map mocobot; the columns are "
    "t, q. No map was given (--map): `mocobot map 'my log.txt'` drafts one",
    "table.parquet": "table.parquet: missing column 'omnid1.phi1' for phi1 of robot 1 by map mocobot; the columns "
    "are a. No map was given (--map): `mocobot map table.parquet` drafts one",
    "log.h5": f"log.h5: is of no known format; a log is {LOGS}",
    "lone.truth.json": "lone.truth.json: is a JSON file, not a recording of mocobot; recordings are .parquet files",
}
"""Files that are neither recordings nor logs that can be read as they are."""

LOGS_ONLY = {
    "log.csv": "log.csv: is a table of text, not a recording of mocobot; use mocobot convert log.csv log.parquet",
    "'my log.txt'": "my log.txt: is a table of text, not a recording of mocobot; use mocobot convert 'my log.txt' "
    "'my log.parquet'",
    "log.npz": "log.npz: is an NPZ archive, not a recording of mocobot; use mocobot convert log.npz log.parquet",
    "log.mcap": "log.mcap: is a ROS 2 bag, not a recording of mocobot; use mocobot convert log.mcap log.parquet",
    "bag": "bag: is a ROS 2 bag, not a recording of mocobot; use mocobot convert bag bag.parquet",
    "table.parquet": "table.parquet: is a Parquet file, not a recording of mocobot; use mocobot convert "
    "table.parquet table_recording.parquet",
}
"""Logs, where only recordings are taken."""

INSPECTED = {
    "none.parquet": "none.parquet: there is no such file",
    "empty.parquet": "empty.parquet: not a readable Parquet file, or a damaged one (Parquet file size is 0 bytes)",
    "text.parquet": "text.parquet: is named .parquet, but does not begin like one; it is damaged or something else",
    "folder": "folder: is a directory, and neither a rosbag2 bag nor a LeRobot dataset",
    "log.h5": f"log.h5: is of no known format; a log is {LOGS}",
}
"""Files that are no logs either."""


@pytest.fixture(scope="module")
def desk(tmp_path_factory) -> Path:
    """A folder as it looks after an hour: one recording, logs of other formats, results, broken files."""
    desk = tmp_path_factory.mktemp("desk")
    recording = small_recording(rows=600)
    write_recording(recording, desk / "rec.parquet")
    write_text(desk / "log.csv", recording.columns())
    np.savez(desk / "log.npz", **recording.columns())  # type: ignore[arg-type]
    write_bag(recording, desk / "log.mcap")
    write_bag(recording, desk / "bag")
    pq.write_table(pa.table({"a": [1.0, 2.0]}), desk / "table.parquet")
    (desk / "cut.parquet").write_bytes((desk / "rec.parquet").read_bytes()[:4000])
    (desk / "log.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    (desk / "folder").mkdir()
    write_json(desk / "paper" / "paper.json", {})
    write_json(desk / "verdict" / "diagnosis.json", small_diagnosis())
    list_written(desk / "verdict", "diagnosis")
    for name, text in {
        "my log.txt": "t,q\n0,1\n", "text.parquet": "time,phi\n", "half.xml": "<mujoco>", "data.mat": "MATLAB 5.0",
        "lone.truth.json": "{}", "empty.json": "", "empty.toml": "", "empty.parquet": "", "old.parquet": "mine",
        "old.rrd": "mine", "page.html": "mine",
    }.items():  # fmt: skip
        (desk / name).write_text(text)
    return desk


@pytest.fixture
def answer(desk, capsys, monkeypatch) -> Callable[[str], str]:
    """The sentence that refuses a command line; it leaves every file as it was."""
    monkeypatch.chdir(desk)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "RERUN"):
        monkeypatch.delenv(name, raising=False)

    def ask(line: str) -> str:
        before = _files(desk)
        sentence = refused(capsys, *shlex.split(line)).removeprefix("mocobot: ")
        assert _files(desk) == before
        return sentence

    return ask


def _files(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of the last change of everything in a folder."""
    return {str(path): (path.stat().st_size, path.stat().st_mtime_ns) for path in folder.rglob("*")}


def said(sentence: str, expected: str) -> bool:
    """Whether a sentence is the expected one, in which three points stand for anything."""
    return re.fullmatch(".*".join(re.escape(part) for part in expected.split("...")), sentence) is not None


LINES = {
    **WORDS,
    **{f"simulate --out new.parquet {options}": sentence for options, sentence in SIMULATE.items()},
    **{f"paper {options}": sentence for options, sentence in PAPER.items()},
    **OPTIONS,
    **OUTPUTS,
    **{f"estimate {file} --out new.json": sentence for file, sentence in FILES.items()},
    **{f"inspect {file} --json new.json": sentence for file, sentence in INSPECTED.items()},
    **{f"replay {file} --save new.rrd": sentence for file, sentence in LOGS_ONLY.items()},
    "report log.csv --out new.html": LOGS_ONLY["log.csv"],
    "diagnose data.mat": "data.mat: is not a MATLAB file of level 5, or a damaged one; save it with -v7",
}


@pytest.mark.parametrize("line", LINES)
def test_one_sentence(answer, line):
    sentence = answer(line)
    assert said(sentence, LINES[line]), sentence
