"""Maps and logs that were damaged at random: a result or one sentence, never anything else."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import JOINTS, MAP, SLIDES, columns, write_csv, write_table
from mocobot_logs.joints.joint_map import read_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log

TIME = np.arange(400) / 250.0
FULL = (
    MAP
    + """
[joint.hip]
gear = 3
zero = 0.1
[drive]
torque_constant = 0.1
coupling.knee = { hip = 2 }
[control]
command = "none"
supply_V = 24
[[log]]
match = "*.csv"
position_gain = [1, 2, 3]
"""
)
WORDS = (
    "-1", "0", "1e400", "nan", "inf", '""', '"x"', "[]", "[1, 2, 3]", "{}", "true", "false", '"free"',
    "99999999999999999999",
    '"{joint}"', '"{"', '"{}"', '"[0]"', "[[1]]", '"hip"', "1.5", '"deg"', '"counts"',
    "-0.0", '"\\u0000"', "2020-01-01",
)  # fmt: skip
CELLS = ("", "nan", "inf", "-1e308", "1e309", "x", '"', "1;2", "1,2", "\0", "0x10", "  3", "-", "1e5", "٣")


def mutated_map(rng: random.Random) -> str:
    """A map with some of its values, keys or lines changed."""
    lines = FULL.strip().splitlines()
    for _ in range(rng.choice((1, 1, 2, 4))):
        k = rng.randrange(len(lines))
        what = rng.randrange(6)
        if what == 0:
            del lines[k]
        elif what == 1:
            lines.insert(k, lines[rng.randrange(len(lines))])
        elif what == 2 and "=" in lines[k]:
            lines[k] = lines[k].partition("=")[0] + "= " + rng.choice(WORDS)
        elif what == 3 and "=" in lines[k]:
            key, _, value = lines[k].partition("=")
            lines[k] = key.strip()[:-1] + " =" + value
        elif what == 4 and lines[k]:
            at = rng.randrange(len(lines[k]))
            lines[k] = lines[k][:at] + chr(rng.randrange(32, 0x250)) + lines[k][at + 1 :]
        else:
            lines[k] = lines[k].replace("hip", rng.choice(("knee", "", "h\u00ef p", "lift")))
        if not lines:
            lines = [""]
    return "\n".join(lines) + "\n"


def mutated_bytes(content: bytes, rng: random.Random) -> bytes:
    """A file with some of its bytes changed, cut out, repeated or cut off."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 2, 8))):
        at = rng.randrange(max(len(data), 1))
        what = rng.randrange(4)
        if what == 0 and data:
            data[at] = rng.randrange(256)
        elif what == 1:
            del data[at : at + rng.choice((1, 16, 500))]
        elif what == 2:
            data[at:at] = data[at : at + rng.choice((1, 16, 500))]
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def outcome(log: Path, map_file: Path) -> str | None:
    """What is said, None if the log is read; anything but a sentence goes through."""
    try:
        log_map = read_joint_map(map_file, JOINTS, SLIDES)
        parts = read_joint_log(open_joint_log(log, log_map), log_map)
    except InputError as error:
        said = str(error)
        assert said.isprintable(), said
        assert len(said) < 1000, said
        assert said.startswith((f"map {map_file}", str(log))), said
        return said
    assert all(np.isfinite(part.q).all() for part in parts)
    return None


def test_damaged_maps(tmp_path) -> None:
    log = write_csv(tmp_path / "log.csv", columns(TIME))
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    assert outcome(log, map_file) is None
    said = []
    for seed in range(300):
        map_file.write_text(mutated_map(random.Random(seed)), encoding="utf-8")
        said.append(outcome(log, map_file))
    assert sum(each is None for each in said) > 15
    assert sum(each is not None for each in said) > 150
    assert len(set(said)) > 80


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_damaged_logs(tmp_path, suffix) -> None:
    log = write_table(tmp_path / f"log{suffix}", columns(TIME))
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    content = log.read_bytes()
    assert outcome(log, map_file) is None
    said = []
    for seed in range(100):
        log.write_bytes(mutated_bytes(content, random.Random(seed)))
        said.append(outcome(log, map_file))
    assert sum(each is not None for each in said) > 10


def test_odd_cells(tmp_path) -> None:
    map_file = tmp_path / "log.toml"
    map_file.write_text(FULL, encoding="utf-8")
    log = write_csv(tmp_path / "log.csv", columns(TIME))
    lines = log.read_text().splitlines()
    said = []
    for seed in range(120):
        rng = random.Random(seed)
        rows = list(lines)
        for _ in range(rng.choice((1, 3, 60))):
            k = rng.randrange(1, len(rows))
            cells = rows[k].split(",")
            cells[rng.randrange(len(cells))] = rng.choice(CELLS)
            rows[k] = ",".join(cells)
        log.write_text("\n".join(rows) + "\n", encoding="utf-8")
        said.append(outcome(log, map_file))
    assert sum(each is None for each in said) > 10
    assert sum(each is not None for each in said) > 50
