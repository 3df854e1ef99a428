"""Robots that are called by names."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.errors import InputError
from log_files import assert_same, read_log, write_text
from mocobot_logs.bag.write import write_bag
from mocobot_logs.maps import builtin_map_text, parse_map
from recordings import small_recording

RECORDING = small_recording(rows=60, ref=False)
NAMED = builtin_map_text("mocobot").replace("omnid{robot}.", "{name}/")


def values(head: str = 'names = ["alice", "bob", "carol"]', text: str = NAMED) -> dict[str, Any]:
    return tomllib.loads(f"{head}\n{text}")


def complaint(given: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        parse_map(given, "my.toml")
    return str(caught.value)


def named(order: tuple[str, ...] = ("alice", "bob", "carol")) -> dict[str, np.ndarray]:
    return {
        key if key == "time" else f"{order[int(key[5]) - 1]}/{key[7:]}": value
        for key, value in RECORDING.columns().items()
    }


def test_columns_by_name(tmp_path: Path) -> None:
    path = write_text(tmp_path / "log.csv", named())
    assert_same(read_log(path, parse_map(values(), "m")), RECORDING)
    two = read_log(path, parse_map(values('names = ["carol", "alice"]'), "m"))
    assert two.robots == 2
    np.testing.assert_array_equal(two.streams[0].values[:, :3], RECORDING.phi[:, 2])


def test_overrides_and_time_by_name(tmp_path: Path) -> None:
    """Robot 2 turns theta_z the other way, by name or by number; every robot has a clock of its own."""
    columns = named()
    time = columns.pop("time")
    columns |= {f"{name}/t": time + k for k, name in enumerate(("alice", "bob", "carol"))}
    text = NAMED.replace('[time]\nunit = "s"', '[time]\ncolumn = "{name}/t"\nunit = "s"')
    for key in ("bob", "2"):
        log_map = parse_map(values(text=f"{text}\n[robot.{key}.channels.theta_z]\nsign = -1\n"), "m")
        log = read_log(write_text(tmp_path / "log.csv", columns), log_map)
        np.testing.assert_array_equal(log.streams[1].values[:, 3], -RECORDING.theta[:, 1, 0])
        np.testing.assert_array_equal(log.streams[0].values[:, 3], RECORDING.theta[:, 0, 0])
        assert [s.stamp_ns[0] for s in log.streams] == [0, 10**9, 2 * 10**9]


def test_topics_by_name(tmp_path: Path) -> None:
    write_bag(RECORDING, tmp_path / "log.mcap")
    text = builtin_map_text("mocobot-ros2").replace("omnid{robot}", "{name}")
    log = read_log(
        tmp_path / "log.mcap", parse_map(values('names = ["omnid3", "omnid1", "omnid2"]', text), "m")
    )
    np.testing.assert_array_equal(log.streams[0].values[:, :3], RECORDING.phi[:, 2])
    np.testing.assert_array_equal(log.streams[1].values[:, :3], RECORDING.phi[:, 0])


def test_a_name_that_the_log_lacks(tmp_path: Path) -> None:
    path = write_text(tmp_path / "log.csv", named())
    with pytest.raises(InputError, match=r"missing column 'dave/phi1' for phi1 of robot 3"):
        read_log(path, parse_map(values('names = ["alice", "bob", "dave"]'), "m"))


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("", "missing key 'names', which goes with the placeholder '{name}'"),
        ("robots = 2\nnames = ['a', 'b', 'c']", "robots is 2, but names has 3"),
        ("names = []", "it must be a list of distinct names"),
        ("names = ['a', 'a']", "it must be a list of distinct names"),
        ("names = ['a', '']", "it must be a list of distinct names"),
        ("names = ['a', 3]", "it must be a list of distinct names"),
        ("names = 'alice'", "it must be a list of distinct names"),
    ],
)
def test_slips(head: str, words: str) -> None:
    assert words in complaint(values(head))


def test_slips_of_tables() -> None:
    without = builtin_map_text("mocobot")
    assert "names is given, but neither a channel nor time holds" in complaint(values(text=without))
    override = f"{NAMED}\n[robot.dave.channels.theta_z]\nsign = -1\n"
    assert (
        "robot.dave: there is no such robot; robots are counted from 1 to 3, or called alice, bob, carol"
        in complaint(values(text=override))
    )
    twice = f"{NAMED}\n[robot.bob.channels.theta_z]\nsign = -1\n[robot.2.channels.theta_x]\nsign = -1\n"
    assert "robot 2 has a table already" in complaint(values(text=twice))
