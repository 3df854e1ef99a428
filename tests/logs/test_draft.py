"""Drafts of maps: logs of many names and units are read by them as they stand, and what is doubtful is said."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.errors import InputError
from log_files import channels_of, read_log, write_lerobot, write_text
from mocobot_logs.bag.write import write_bag
from mocobot_logs.convert import write_csv, write_npz
from mocobot_logs.draft import draft_of, team_draft
from mocobot_logs.draft_joints import draft_joint_map
from mocobot_logs.draft_names import Candidate, find_channels, read_name
from mocobot_logs.maps import LogMap, parse_map
from recordings import small_recording

RECORDING = small_recording(rows=200, ref=False)
JOINT = ("phi1", "phi2", "phi3", "theta_z", "theta_y", "theta_x", "tau1", "tau2", "tau3")
Name = Callable[[int, str], str]


def table(name: Name, scale: Callable[[str], float] = lambda _: 1.0, time: tuple[str, float] = ("time", 1.0)):
    columns = {time[0]: RECORDING.time * time[1]}
    for robot in range(3):
        for channel, values in zip(JOINT, channels_of(RECORDING, robot).T, strict=True):
            columns[name(robot, channel)] = values * scale(channel)
    return columns


def drafted(path: Path) -> LogMap:
    """The draft as a map; nothing of it is doubtful."""
    draft = draft_of(path)
    assert draft.doubtful == 0, draft.text
    assert not draft.missing
    assert "doubtful" not in draft.text.split("\n", 2)[2]
    return parse_map(tomllib.loads(draft.text), "draft")


def assert_reads(path: Path, log_map: LogMap, tolerance: float = 1e-12) -> None:
    log = read_log(path, log_map)
    assert log.robots == 3
    for robot, stream in enumerate(log.streams):
        np.testing.assert_allclose(
            stream.values, channels_of(RECORDING, robot), rtol=tolerance, atol=tolerance
        )
        np.testing.assert_allclose(stream.stamp_ns - stream.stamp_ns[0], RECORDING.time * 1e9, atol=1)


PEOPLE = ("alice", "bob", "carol")
GIMBAL = {"phi": "joint{}_position", "tau": "joint{}_effort", "theta": "gimbal_{}"}


def in_deg(channel: str) -> float:
    return 1e3 if channel.startswith("tau") else 180 / np.pi


def ros(channel: str) -> str:
    return GIMBAL[channel.rstrip("123_xyz")].format(channel[-1])


LOGS: dict[str, tuple[Name, Callable[[str], float], tuple[str, float]]] = {
    "numbers": (lambda r, c: f"r{r + 1}_{c}", lambda _: 1.0, ("t", 1.0)),
    "numbers from 0": (lambda r, c: f"robot{r}/{c}", lambda _: 1.0, ("time_ms", 1e3)),
    "people": (lambda r, c: f"{PEOPLE[r]}.{c}", lambda _: 1.0, ("timestamp", 1e3)),
    "units": (
        lambda r, c: f"{PEOPLE[r]}_{c}" + ("[mNm]" if "tau" in c else "_deg"), in_deg, ("t[us]", 1e6)
    ),
    "units in words": (
        lambda r, c: f"{c} {PEOPLE[r]} ({'N m' if 'tau' in c else 'degrees'})",
        lambda c: 1.0 if "tau" in c else 180 / np.pi, ("stamp [ns]", 1e9),
    ),
    "units by values": (lambda r, c: f"{c}_r{r + 1}", in_deg, ("time", 1e9)),
    "ROS": (lambda r, c: f"/omnid{r + 1}/joint_states/{ros(c)}", lambda _: 1.0, ("t", 1.0)),
    "sparse numbers": (lambda r, c: f"cobot{3 * r + 4}.{c}", lambda _: 1.0, ("t", 1.0)),
    "camels": (lambda r, c: f"Robot{r + 1}{c.capitalize()}", lambda _: 1.0, ("time", 1.0)),
    "other words": (
        lambda r, c: f"{PEOPLE[r]}_{c.replace('tau', 'torque').replace('phi', 'q')}", lambda _: 1.0, ("t", 1.0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LOGS)
def test_a_draft_reads_its_log(tmp_path: Path, name: str) -> None:
    path = write_text(tmp_path / "log.csv", table(*LOGS[name]))
    assert_reads(path, drafted(path))


def test_what_the_draft_calls_robots(tmp_path: Path) -> None:
    def head(name: str) -> str:
        text = draft_of(write_text(tmp_path / "log.csv", table(*LOGS[name]))).text
        return "\n".join(text.splitlines()[2:6])

    assert "robots = 3" in head("numbers")
    assert 'names = ["alice", "bob", "carol"]' in head("people")
    assert 'names = ["4", "7", "10"]' in head("sparse numbers")


@pytest.mark.parametrize("name", ["log.csv", "log.npz", "log.mcap", "lerobot", "wrist.csv", "wrist.mcap"])
def test_drafts_of_what_needs_no_map(tmp_path: Path, name: str) -> None:
    """They say the same as the built-in maps."""
    path = tmp_path / name
    level = "wrist" if name.startswith("wrist") else "joint"
    if name == "lerobot":
        write_lerobot(path, [RECORDING])
    elif name.endswith(".mcap"):
        write_bag(RECORDING, path, level=level)
    else:
        (write_csv if name.endswith(".csv") else write_npz)(RECORDING, path, level)
    draft = draft_of(path)
    log, known = read_log(path, parse_map(tomllib.loads(draft.text), "draft")), read_log(path)
    assert (log.level, log.robots) == (level, 3)
    for one, other in zip(log.streams, known.streams, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        np.testing.assert_array_equal(one.stamp_ns, other.stamp_ns)
    if name == "log.npz":  # theta[.., 0] says nothing about its axis
        assert draft.doubtful == 3
    else:
        assert draft.doubtful == 0


def test_commands_are_optional(tmp_path: Path) -> None:
    recording = small_recording(rows=200)
    write_bag(recording, tmp_path / "log.mcap")
    text = draft_of(tmp_path / "log.mcap").text
    assert (
        'ref_x = { topic = "/omnid{robot}/wrist/command", field = "point.x", unit = "m", optional = true }'
        in text
    )
    log = read_log(tmp_path / "log.mcap", parse_map(tomllib.loads(text), "draft"))
    np.testing.assert_array_equal(log.streams[1].values, channels_of(recording, 1))


# Doubts


def doubts(path: Path) -> dict[str, str]:
    """What is doubtful, by channel."""
    draft = draft_of(path)
    found = dict(re.findall(r"^#? ?(\w+) = .*# doubtful: (.*)$", draft.text, re.MULTILINE))
    assert draft.doubtful >= len(found)
    return found


def test_counts_must_be_filled_in(tmp_path: Path) -> None:
    columns = table(lambda r, c: f"r{r + 1}_{c}")
    columns |= {k: np.rint(v * 65536 / (2 * np.pi)) for k, v in columns.items() if "phi" in k}
    path = write_text(tmp_path / "log.csv", columns)
    draft = draft_of(path)
    assert draft.missing == ("phi1", "phi2", "phi3")
    assert "counts_per_turn must be filled in" in doubts(path)["phi2"]
    with pytest.raises(InputError, match="missing key 'phi1'"):
        parse_map(tomllib.loads(draft.text), "draft")
    filled = re.sub(r"# (phi\d = .*) = \?", r"\1 = 65536", draft.text)
    assert_reads(path, parse_map(tomllib.loads(filled), "draft"), 1e-4)


def test_names_that_may_mean_two_things(tmp_path: Path) -> None:
    columns = table(lambda r, c: f"r{r + 1}_{c}")
    columns |= {f"r{r}_phi1_filtered": columns[f"r{r}_phi1"] for r in (1, 2, 3)}
    path = write_text(tmp_path / "log.csv", columns)
    found = doubts(path)
    assert set(found) == {"phi1"}
    assert "or r{robot}_phi1_filtered?" in found["phi1"]
    assert_reads(path, parse_map(tomllib.loads(draft_of(path).text), "draft"))
    turns = {"theta_z": "yaw", "theta_y": "pitch", "theta_x": "roll"}
    path = write_text(tmp_path / "log.csv", table(lambda r, c: f"r{r + 1}_{turns.get(c, c)}"))
    assert set(doubts(path)) == set(turns)
    assert_reads(path, parse_map(tomllib.loads(draft_of(path).text), "draft"))


def test_what_is_not_there(tmp_path: Path) -> None:
    """A channel, one channel of one robot, the time; other columns are listed."""
    columns = table(lambda r, c: f"{PEOPLE[r]}_{c}")
    del columns["bob_tau2"], columns["time"]
    for name in PEOPLE:
        columns[f"{name}_theta_roll_rate"] = columns.pop(f"{name}_theta_x")
        columns[f"{name}_temperature1"] = columns[f"{name}_phi1"]
    columns["remark"] = columns["alice_phi1"]
    text = draft_of(write_text(tmp_path / "log.csv", columns)).text
    assert "doubtful: nothing is called like time" in text
    assert "no such name for bob" in text
    assert "nothing is called like theta_x" in text
    assert "temperature" not in text


@pytest.mark.parametrize(
    ("name", "group", "index", "unit"),
    [
        ("omnid1.phi2", "phi", 2, None),
        ("q3_deg", "phi", 3, "deg"),
        ("torque_1 [mN m]", "tau", 1, "mNm"),
        ("fx(N)", "force", 0, "N"),
        ("r2/wrench.force.z", "force", 2, None),
        ("h_y_mm", "h", 1, "mm"),
        ("wrist_command_x", "ref", 0, None),
        ("gimbal_z", "theta", 2, None),
        ("tau_3_m", "tau", 3, None),
        ("clock_ns", "time", None, "ns"),
    ],
)
def test_what_a_name_says(name: str, group: str, index: int | None, unit: str | None) -> None:
    found = read_name(name)
    assert found is not None
    assert (found.group, found.index, found.unit) == (group, index, unit)


# The command


WORDS = st.lists(
    st.sampled_from(
        ["phi", "tau", "theta", "q", "x", "y", "z", "1", "2", "3", "0", "_", "/", ".", " ", "[", "]", "deg", "mNm",
         "force", "ref", "time", "t", "alice", "bob", "\x1f", "\0", '"', "\\", "\n", "{", "}", "é", "#"]
    ), max_size=9,
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.lists(WORDS.map("".join), max_size=25, unique=True), st.floats(-1e12, 1e12))
def test_whatever_columns_are_called_the_draft_is_toml(names: list[str], value: float) -> None:
    values = np.array([value, 0.0])
    found = [
        Candidate(n, ("column",), r, values)
        for n in names
        if "\x1f" not in n and (r := read_name(n)) is not None
    ]
    draft = team_draft(Path("log\n.csv"), find_channels(found), [])
    parsed = tomllib.loads(draft.text)
    assert parsed["version"] == 1
    if not draft.missing:
        with suppress(InputError):  # names without a robot in them, for example
            parse_map(parsed, "draft")


def test_angles_that_start_again_after_a_turn(tmp_path: Path) -> None:
    """They are no degrees; what is said is what has to be done."""
    columns = {
        name: np.mod(x - x.mean(), 2 * np.pi) if "theta" in name else x
        for name, x in RECORDING.columns().items()
    }
    path = write_text(tmp_path / "log.csv", columns)
    lines = [line for line in draft_of(path).text.splitlines() if line.startswith("theta")]
    assert len(lines) == 3
    assert all('unit = "rad"' in line and "doubtful: rad that jump by a full turn" in line for line in lines)


JOINTS = ("shoulder", "elbow")


def written(folder: Path, names: list[str], *, comma: bool = False) -> Path:
    values = np.random.default_rng(0).standard_normal((200, len(names) - 1)) * 20.0
    text = [";".join(names)]
    for k, row in enumerate(values):
        cells = ";".join([f"{0.01 * k:.3f}", *(f"{x:.5f}" for x in row)])
        text.append(cells.replace(".", ",") if comma else cells)
    path = folder / "log.csv"
    path.write_text("\n".join(text) + "\n", encoding="utf-8-sig" if comma else "utf-8")
    return path


@pytest.mark.parametrize(
    ("called", "said"),
    [
        ("torque_{}_Nmm", '"Nmm"'),
        ("torque {} [mNm]", '"mNm"'),
        ("Position {} [deg]", '"deg"'),
        ("velocity_{} (deg/s)", '"deg/s"'),
        ("motor speed {} [rpm]", '"rpm"'),
        ("current {} [mA]", '"mA"'),
    ],
)
def test_units_in_names_are_read(tmp_path, called: str, said: str) -> None:
    path = written(tmp_path, ["time", called.format(1), called.format(2)])
    (line,) = (s for s in draft_joint_map(path, JOINTS, [False, False]).text.splitlines() if "{number}" in s)
    assert f"unit = {said} }}  # -" in line, line  # and what the column holds, without a doubt
