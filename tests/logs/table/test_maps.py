"""Maps of measured logs: units against their definitions, robots by name, and every slip named with what is allowed."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.errors import InputError
from log_files import assert_same, read_log, write_text
from mocobot_logs.bag.write import write_bag
from mocobot_logs.log import CHANNELS, REF
from mocobot_logs.maps import KEYS, MAPS, builtin_map, builtin_map_text, parse_map, read_map, units_of
from recordings import small_recording

ROOT = Path(__file__).resolve().parents[3]
UNITS = {"phi": "rad", "theta": "rad", "tau": "Nm", "h": "m", "force": "N", "ref": "m"}


def unit(channel: str) -> str:
    return UNITS[channel.split("_")[0].rstrip("123")]


def joint_map(**changes: Any) -> dict[str, Any]:
    """A complete map at joint level, to be spoiled."""
    channels = {name: {"column": f"r{{robot}}.{name}", "unit": unit(name)} for name in CHANNELS["joint"]}
    values: dict[str, Any] = {"version": 1, "level": "joint", "channels": channels}
    return values | changes


def with_channel(name: str = "phi1", **changes: Any) -> dict[str, Any]:
    """A complete map, one channel of it changed."""
    values = joint_map()
    merged = values["channels"].get(name, {}) | changes
    values["channels"][name] = {key: value for key, value in merged.items() if value is not ...}
    return values


def complaint(values: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        parse_map(values, "my.toml")
    message = str(caught.value)
    assert message.startswith("map my.toml: ")
    assert "\n" not in message
    assert len(message) < 400
    return message.removeprefix("map my.toml: ")


# What a map does


@pytest.mark.parametrize(
    ("name", "settings", "raw", "si"),
    [
        ("phi1", {"unit": "rad"}, 0.5, 0.5),
        ("phi1", {"unit": "deg"}, 180.0, math.pi),
        ("theta_x", {"unit": "deg", "sign": -1, "offset": 10.0}, 80.0, -math.pi / 2),
        ("theta_z", {"unit": "counts", "counts_per_turn": 65536}, 16384.0, math.pi / 2),
        ("phi3", {"unit": "counts", "counts_per_turn": 4096, "offset": -1024}, 2048.0, math.pi / 2),
        ("tau2", {"unit": "mNm"}, 1500.0, 1.5),
        ("tau2", {"unit": "mN m", "sign": -1}, 1500.0, -1.5),
        ("tau2", {"unit": "N m", "offset": 0.25}, 1.5, 1.75),
    ],
)
def test_units(name: str, settings: dict[str, Any], raw: float, si: float) -> None:
    channel = parse_map(with_channel(name, **settings), "m").channels(1)[name]
    assert channel.apply(np.array([raw])) == pytest.approx(si, rel=1e-15)
    assert channel.undo(np.array([si])) == pytest.approx(raw, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "unit", "si"),
    [("h_x", "mm", 1e-3), ("ref_z", "mm", 1e-3), ("force_y", "mN", 1e-3), ("h_z", "m", 1.0)],
)
def test_units_of_the_wrist(name: str, unit: str, si: float) -> None:
    values = tomllib.loads(builtin_map_text("mocobot-wrist"))
    values["channels"][name]["unit"] = unit
    assert parse_map(values, "m").channels(1)[name].apply(np.ones(1)) == pytest.approx(si, rel=1e-15)


def test_samples_in_si_stay_as_they_are() -> None:
    raw = np.random.default_rng(1).normal(size=100)
    assert builtin_map("mocobot").channels(1)["tau1"].apply(raw) is raw


def test_defaults_placeholders_and_overrides() -> None:
    text = """
    version = 1
    level = "joint"
    robots = 2
    trial = "static"
    [time]
    column = "stamp{robot}"
    unit = "ms"
    [defaults]
    column = "{channel}_of_{robot}_{robot0}"
    unit = "counts"
    counts_per_turn = 1000
    [channels]
    phi1 = {}
    phi2 = { unit = "deg" }
    phi3 = { column = "third[{robot0}, 2]", sign = -1 }
    theta_z = {}
    theta_y = {}
    theta_x = {}
    tau1 = { unit = "mNm" }
    tau2 = { unit = "mNm" }
    tau3 = { unit = "mNm" }
    [robot.2.channels.phi3]
    column = "other"
    [robot.2.channels.tau1]
    unit = "Nm"
    sign = -1
    """
    log_map = parse_map(tomllib.loads(text), "m")
    one, two = log_map.channels(1), log_map.channels(2)
    assert tuple(one) == CHANNELS["joint"] == log_map.names
    assert (log_map.robots, log_map.trial, log_map.time.unit_ns) == (2, "static", 1_000_000)
    assert (log_map.time_column(1), log_map.time_column(2)) == ("stamp1", "stamp2")
    assert (one["phi1"].column, two["phi1"].column) == ("phi1_of_1_0", "phi1_of_2_1")
    assert (one["phi3"].column, two["phi3"].column) == ("third[0, 2]", "other")
    assert one["phi3"].scale == two["phi3"].scale == -2 * math.pi / 1000  # an override keeps the rest
    assert (one["phi2"].scale, one["tau1"].scale, two["tau1"].scale) == (math.pi / 180, 1e-3, -1.0)


# Built-in maps


@pytest.mark.parametrize("name", MAPS)
def test_builtin_maps_are_complete_and_in_si(name: str) -> None:
    log_map = read_map(name)
    assert log_map is builtin_map(name)
    assert log_map.names == (*CHANNELS[log_map.level], *REF)
    for robot in (1, 3):
        for channel, where in log_map.channels(robot).items():
            assert (where.scale, where.offset) == (1.0, 0.0)
            assert where.optional == (channel in REF)
            assert "{" not in f"{where.topic}{where.joint}{where.field}{where.column}"


def test_the_omnids_bags() -> None:
    """Wrist position and force are position and effort of joints x, y, z; the gimbal has joints of its own."""
    channels = builtin_map("omnid-ros2").channels(2)
    topic = "/omnid2/joint/joint_states"
    for axis in "xyz":
        h, force, theta = (channels[f"{kind}_{axis}"] for kind in ("h", "force", "theta"))
        assert (h.topic, h.joint, h.field) == (topic, axis, "position")
        assert (force.topic, force.joint, force.field) == (topic, axis, "effort")
        assert (theta.topic, theta.joint, theta.field) == (topic, f"gimbal_{axis}", "position")


# What a map must not hold


SLIPS: list[tuple[dict[str, Any], list[str]]] = [
    (joint_map(version=2), ["version is 2", "reads version 1"]),
    (joint_map(version=True), ["version is True"]),
    (joint_map(version=2, news=1), ["version is 2"]),
    ({"level": "joint", "channels": {}}, ["missing key 'version'", "version, level, channels"]),
    ({"version": 1, "channels": {}}, ["missing key 'level'"]),
    (joint_map(level="motor"), ["level is 'motor'", "'joint', 'wrist'"]),
    (joint_map(level=["joint"]), ["level is ['joint']"]),
    (joint_map(level="wrist"), ["unknown key 'phi1'", "h_x"]),
    (joint_map(chanels={}), ["unknown key 'chanels' (did you mean 'channels'?)", "defaults"]),
    (joint_map(robots=0), ["robots is 0", "1 to 1000"]),
    (joint_map(robots=2.0), ["robots is 2.0"]),
    (joint_map(robots=10**30), ["robots is 1000", "1 to 1000"]),
    (joint_map(trial="walk"), ["trial is 'walk'", "'random', 'periodic', 'static'"]),
    (joint_map(channels=3), ["channels is 3", "table"]),
    (joint_map(time=[]), ["time is []", "table"]),
    (joint_map(time={"colum": "t"}), ["time: unknown key 'colum' (did you mean 'column'?)"]),
    (joint_map(time={"column": "t"}), ["time: missing key 'unit'"]),
    (joint_map(time={"column": "t", "unit": "min"}), ["time: unit is 'min'", "'s', 'ms', 'us', 'ns'"]),
    (joint_map(time={"clock": "wall"}), ["time: clock is 'wall'", "'header', 'log'"]),
    (joint_map(csv={"delimiter": ",,"}), ["csv: delimiter is ',,'"]),
    (joint_map(csv={"delimiter": ",", "decimal": ","}), ["csv: delimiter and decimal are both"]),
    (joint_map(csv={"decimal": "'"}), ["csv: decimal is"]),
    (joint_map(defaults={"topics": "/a"}), ["defaults: unknown key 'topics'", "topic, joint, field"]),
    (joint_map(robot={"0": {}}), ["robot.0", "counted from 1"]),
    (joint_map(robots=3, robot={"4": {}}), ["robot.4", "1 to 3"]),
    (joint_map(robot={"two": {}}), ["robot.two", "counted from 1"]),
    (joint_map(robot={"2": 5}), ["robot.2 is 5", "table"]),
    (joint_map(robot={"2": {"time": {}}}), ["robot.2: unknown key 'time'", "channels"]),
    (joint_map(robot={"2": {"channels": {"h_x": {}}}}), ["robot.2.channels: unknown key 'h_x'", "phi1"]),
    (
        joint_map(robot={"2": {"channels": {"phi1": {"sine": 1}}}}),
        ["robot.2.channels.phi1: unknown key 'sine'"],
    ),
    (
        joint_map(robot={"2": {"channels": {"phi1": {"unit": "m"}}}}),
        ["robot.2.channels.phi1: unit is 'm'"],
    ),
    (with_channel("phi4", column="a", unit="rad"), ["unknown key 'phi4'", "phi1, phi2, phi3"]),
    (with_channel("ref_x", column="a", unit="m"), ["channels: missing key 'ref_y'"]),
    (with_channel(unit=...), ["channels.phi1: missing key 'unit'", "rad, deg, counts"]),
    (
        with_channel(unit="grad"),
        ["channels.phi1: unit is 'grad'", "angles come in rad, deg, counts"],
    ),
    (with_channel(unit=1), ["channels.phi1: unit is 1", "rad"]),
    (
        with_channel("tau1", unit="counts", counts_per_turn=10),
        ["unit is 'counts'", "torques come in Nm"],
    ),
    (with_channel("tau1", unit="N"), ["unit is 'N'", "Nm, mNm"]),
    (with_channel(unit="counts"), ["channels.phi1: missing key 'counts_per_turn'"]),
    (with_channel(counts_per_turn=100), ["counts_per_turn does not go with angles in 'rad'; leave it out"]),
    (with_channel(unit="counts", counts_per_turn=0.5), ["counts_per_turn is 0.5", "at least 1"]),
    (with_channel(unit="counts", counts_per_turn=math.nan), ["counts_per_turn is nan"]),
    (with_channel(sign=0), ["channels.phi1: sign is 0", "1 or -1"]),
    (with_channel(sign=1.0), ["sign is 1.0"]),
    (with_channel(sign=True), ["sign is True"]),
    (with_channel(offset="1"), ["offset is '1'", "finite number"]),
    (with_channel(offset=math.inf), ["offset is inf"]),
    (with_channel(offset=10**400), ["offset is 1000"]),
    (with_channel(optional=True), ["optional is True", "ref_x, ref_y, ref_z only"]),
    (with_channel("tau1", optional=1), ["optional is 1"]),
    (with_channel(column=...), ["channels.phi1: missing key 'column'", "topic and a field (bags)"]),
    (with_channel(column=..., topic="/a"), ["missing key 'field'"]),
    (with_channel(column=..., field="a.b"), ["missing key 'topic'"]),
    (
        with_channel(topic="/a", field="angle", joint="x"),
        ["field is 'angle'", "position, velocity, effort"],
    ),
    (with_channel(column=""), ["column is ''"]),
    (with_channel(column="a\nb"), ["column is 'a\\nb'", "printable"]),
    (with_channel(column=["a"]), ["column is ['a']"]),
    (with_channel(column="r{i}.phi1"), ["placeholder '{i}'", "{robot}, {robot0}, {name}, {channel}"]),
    (with_channel(column="r{}.phi1"), ["placeholder '{}'"]),
    (with_channel(column="r{robot.__class__}"), ["placeholder '{robot.__class__}'"]),
]


@pytest.mark.parametrize(("values", "words"), SLIPS, ids=range(len(SLIPS)))
def test_slips_are_named(values: dict[str, Any], words: list[str]) -> None:
    message = complaint(values)
    for word in words:
        assert word in message


@pytest.mark.parametrize("channel", CHANNELS["joint"])
def test_every_channel_is_needed(channel: str) -> None:
    values = joint_map()
    del values["channels"][channel]
    assert f"channels: missing key '{channel}'" in complaint(values)


def test_every_channel_has_units() -> None:
    for name in (*CHANNELS["joint"], *CHANNELS["wrist"], *REF):
        assert units_of(name)[0] == unit(name)


# Files


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"version = ", ["is not TOML"]),
        (b"[a]\n[a]\n", ["is not TOML"]),
        (b"x = " + b"[" * 5000, ["is not TOML"]),
        (b"\xff\xfe\x00", ["UTF-8"]),
        (b"a = 1\n" * (1 << 18), ["larger than 1 MiB"]),
        (b"", ["missing key 'version'"]),
    ],
    ids=range(6),
)
def test_files_that_are_no_maps(tmp_path: Path, content: bytes, words: list[str]) -> None:
    path = tmp_path / "map.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"map {path}: ")
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_paths_that_are_no_maps(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path, "not a file"),
        (tmp_path / "none", "no such file"),
        ("omnid", "omnid-ros2"),
    ):
        with pytest.raises(InputError, match=words):
            read_map(path)
    for path in ("x" * 5000, "nul\0byte"):
        with pytest.raises(InputError, match=r"map .*(cannot be read|no such file)"):
            read_map(path)
    with pytest.raises(InputError, match=r"'omnid' does not exist; the built-in maps are omnid-ros2"):
        builtin_map("omnid")


DOCUMENTED = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "measured-data.md").read_text(), re.DOTALL)


@pytest.mark.parametrize("block", DOCUMENTED, ids=range(len(DOCUMENTED)))
def test_documented_maps_are_allowed(block: str) -> None:
    """Those that leave channels out are completed first."""
    values = tomllib.loads(block)
    channels = values.setdefault("channels", {})
    level = values.setdefault("level", "wrist" if {"h_x", "force_x"} & set(channels) else "joint")
    for name in CHANNELS[level]:
        channels.setdefault(name, {"column": name, "unit": unit(name)})
    parse_map({"version": 1} | values, "documented").channels(2)


def test_the_docs_name_every_key_unit_and_map() -> None:
    text = (ROOT / "docs" / "measured-data.md").read_text()
    for word in [
        *KEYS,
        *MAPS,
        *(u for name in CHANNELS["joint"] for u in units_of(name) if " " not in u),
    ]:
        assert re.search(rf"[`\s.\[,]{re.escape(word)}[`\s.\]=,\"]", text), word


def test_a_map_may_start_from_a_builtin_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(builtin_map_text("omnid-ros2").replace('unit = "N"', 'unit = "mN"'))
    assert read_map(path).channels(1)["force_x"].scale == 1e-3


RECORDING = small_recording(rows=60, ref=False)
NAMED = builtin_map_text("mocobot").replace("omnid{robot}.", "{name}/")


def values(head: str = 'names = ["alice", "bob", "carol"]', text: str = NAMED) -> dict[str, Any]:
    return tomllib.loads(f"{head}\n{text}")


def complaint_of_map_names(given: dict[str, Any]) -> str:
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
    assert words in complaint_of_map_names(values(head))


def test_slips_of_tables() -> None:
    without = builtin_map_text("mocobot")
    assert "names is given, but neither a channel nor time holds" in complaint_of_map_names(
        values(text=without)
    )
    override = f"{NAMED}\n[robot.dave.channels.theta_z]\nsign = -1\n"
    assert (
        "robot.dave: there is no such robot; robots are counted from 1 to 3, or called alice, bob, carol"
        in complaint_of_map_names(values(text=override))
    )
    twice = f"{NAMED}\n[robot.bob.channels.theta_z]\nsign = -1\n[robot.2.channels.theta_x]\nsign = -1\n"
    assert "robot 2 has a table already" in complaint_of_map_names(values(text=twice))
