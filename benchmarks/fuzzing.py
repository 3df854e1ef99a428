"""Damaged logs and other inputs: made, read in a process of their own, and judged."""

from __future__ import annotations

import json
import re
import resource
import shutil
import signal
import struct
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv
import pyarrow.parquet as pq
from scipy.io import savemat

import mocobot
from discrepancy.joints.model import load_model
from discrepancy.team.causes import read_tolerances
from estimator.arm.design import load_design
from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot.api.comparison import compare
from mocobot.cli import with_config
from mocobot_logs.bag.write import write_bag
from mocobot_logs.draft_joints import draft_joint_map
from mocobot_logs.joints.joint_map import read_joint_map
from mocobot_logs.log import collect
from mocobot_logs.maps import MAPS, builtin_map_text, read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.effects.catalogue import EXAMPLE, parse_effect
from mocobot_sim.scene.as_built import read_units
from mocobot_sim.scene.payload import grasp_frames, load_payload

DESIGN = Path(__file__).parents[1] / "models" / "omnid" / "design.toml"
FORMATS = (
    "csv",
    "npz",
    "npz packed",
    "mat",
    "mat packed",
    "parquet",
    "parquet foreign",
    "lerobot data",
    "lerobot episodes",
    "lerobot info",
    "mcap",
    "mcap wrist",
    "db3",
    "bag yaml",
    "bag mcap",
    "map",
)


def small_recording(rows: int = 200, robots: int = 2, seed: int = 0) -> Recording:
    """Random plausible samples of a few robots."""
    rng, shape, design = np.random.default_rng(seed), (rows, robots, 3), load_design(DESIGN)
    metadata = RecordingMetadata(robots, 100.0, "random", "fuzzing", None, None, design)
    return Recording(
        time=np.arange(rows) / 100.0,
        phi=rng.uniform(0.3, 0.9, shape),
        theta=rng.uniform(-0.2, 0.2, shape),
        tau=rng.uniform(-9.0, 9.0, shape),
        ref=rng.uniform(-0.1, 0.4, shape),
        metadata=metadata,
    )


def write_original(kind: str, folder: Path, rows: int = 200) -> tuple[Path, Path]:
    """Write a good log.

    Args:
        kind: one of ``FORMATS``.
        folder: empty; the log goes into it.
        rows: number of samples of each robot.

    Returns:
        The log as a user would name it, and the file in it that is to be damaged.
    """
    recording = small_recording(rows)
    if kind == "csv":
        pcsv.write_csv(pa.table(recording.columns()), folder / "log.csv")
        return _same(folder / "log.csv")
    if kind.startswith("npz"):
        save = np.savez_compressed if kind.endswith("packed") else np.savez
        arrays = {name: getattr(recording, name) for name in ("time", "phi", "theta", "tau", "ref")}
        save(folder / "log.npz", mocobot=np.array(recording.metadata.to_json()), **arrays)
        return _same(folder / "log.npz")
    if kind.startswith("mat"):
        arrays = {name: getattr(recording, name) for name in ("time", "phi", "theta", "tau", "ref")}
        savemat(folder / "log.mat", arrays, do_compression=kind.endswith("packed"))
        return _same(folder / "log.mat")
    if kind == "parquet":
        write_recording(recording, folder / "log.parquet")
        return _same(folder / "log.parquet")
    if kind == "parquet foreign":
        table = pa.table({name: np.round(values, 2) for name, values in recording.columns().items()})
        pq.write_table(table, folder / "log.parquet", compression="zstd", row_group_size=rows // 3)
        return _same(folder / "log.parquet")
    if kind.startswith("lerobot"):
        return _lerobot(recording, folder / "set", kind.split()[1])
    if kind.startswith("mcap") or kind == "db3":
        path = folder / ("log.mcap" if kind.startswith("mcap") else "log.db3")
        storage = "mcap" if kind.startswith("mcap") else "sqlite3"
        write_bag(recording, path, level="wrist" if kind.endswith("wrist") else "joint", storage=storage)
        return _same(path)
    if kind.startswith("bag"):
        path = folder / "bag"
        write_bag(recording, path, storage="sqlite3" if kind.endswith("yaml") else "mcap")
        return path, next(path.glob(f"*.{kind.split()[1]}"))
    (folder / "map.toml").write_text(builtin_map_text(MAPS[rows % len(MAPS)]))
    return _same(folder / "map.toml")


def _same(path: Path) -> tuple[Path, Path]:
    return path, path


def _lerobot(recording: Recording, folder: Path, part: str) -> tuple[Path, Path]:
    data, episodes = (folder / name / "chunk-000" / "file-000.parquet" for name in ("data", "meta/episodes"))
    for path in (data, episodes):
        path.parent.mkdir(parents=True)
    rows, columns = len(recording.time), replace(recording, ref=None).columns()
    names = [name for name in columns if name != "time"]
    state = np.stack([columns[name] for name in names], axis=1).astype(np.float32)
    frame = np.arange(rows)
    table = pa.table(
        {
            "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), len(names)),
            "timestamp": pa.array(np.float32(frame / 100.0)),
            "frame_index": pa.array(frame),
            "episode_index": pa.array(np.zeros(rows, np.int64)),
        }
    )
    pq.write_table(table, data)
    pq.write_table(
        pa.table({"episode_index": [0], "data/chunk_index": [0], "data/file_index": [0]}), episodes
    )
    info = {
        "codebase_version": "v3.0",
        "fps": 100,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {"observation.state": {"dtype": "float32", "shape": [len(names)], "names": names}},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder, {"data": data, "episodes": episodes, "info": folder / "meta" / "info.json"}[part]


_EXTREMES = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)
_TEXTS = (
    b"nan",
    b"inf",
    b"-1",
    b"1e999",
    b'"',
    b",",
    b"\n",
    b"{",
    b"[[",
    b"\0",
    b"\xff",
    b"9" * 40,
    b"=",
    b"'''",
)


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """A copy of a file with one to four kinds of damage.

    Args:
        content: the good file.
        rng: which damage, and where.
    """
    data = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        if not data:
            break
        data = _DAMAGE[int(rng.integers(len(_DAMAGE)))](data, rng)
    return bytes(data)


def _place(data: bytearray, rng: np.random.Generator) -> int:
    """Anywhere, but half of the time near an end, where headers and footers are."""
    if rng.random() < 0.5:
        near = min(len(data), 2000)
        place = int(rng.integers(near))
        return place if rng.random() < 0.5 else len(data) - 1 - place
    return int(rng.integers(len(data)))


def _flip_bits(data: bytearray, rng: np.random.Generator) -> bytearray:
    for _ in range(int(rng.integers(1, 9))):
        data[_place(data, rng)] ^= 1 << int(rng.integers(8))
    return data


def _set_bytes(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 17))
    data[at : at + count] = rng.bytes(min(count, len(data) - at))
    return data


def _cut_end(data: bytearray, rng: np.random.Generator) -> bytearray:
    return data[: _place(data, rng)]


def _cut_middle(data: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(data, rng)
    del data[at : at + int(rng.integers(1, 400))]
    return data


def _repeat(data: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(data, rng)
    part = bytes(data[at : at + int(rng.integers(1, 400))])
    data[at:at] = part * int(rng.integers(1, 4))
    return data


def _move(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 200))
    part = bytes(data[at : at + count])
    to = _place(data, rng)
    data[to : to + len(part)] = part[: len(data) - to]
    return data


def _extreme(data: bytearray, rng: np.random.Generator) -> bytearray:
    value, at = _EXTREMES[int(rng.integers(len(_EXTREMES)))], _place(data, rng)
    width = int(rng.choice([1, 2, 4, 8]))
    packed = struct.pack("<Q" if rng.random() < 0.7 else ">Q", value)
    packed = packed[:width] if rng.random() < 0.7 else packed[-width:]
    data[at : at + width] = packed[: len(data) - at]
    return data


def _text(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, text = _place(data, rng), _TEXTS[int(rng.integers(len(_TEXTS)))]
    data[at : at + (len(text) if rng.random() < 0.5 else 0)] = text
    return data


def _zeros(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 4096))
    data[at : at + count] = bytes(min(count, len(data) - at))
    return data


_DAMAGE = (_flip_bits, _flip_bits, _set_bytes, _cut_end, _cut_middle, _repeat, _move, _extreme, _text, _zeros)


MODELS = Path(__file__).parents[1] / "models"
OPTIONS = '[simulate]\npayload = "b"\ntrajectory = "random"\nvias = 4\neffect = ["sea_bias:robot=1,joint=2,bias=0.1"]\n'
TOLERANCES = (
    "[sea_bias]\nbias_Nm = 0.02\n\n[link_length]\nproximal_m = 1e-3\nrod_m = 1e-3\nbase_radius_m = 1e-3\n"
)


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        name: of the good one.
        write: puts it at a path.
        read: reads it as a command does.
    """

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], object]
    damage: Callable[[bytes, np.random.Generator], bytes] = damaged


_WORD = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?|[A-Za-z_]\w*")
_NUMBERS = ("0", "-1", "nan", "inf", "1e999", "1e300", "-1e-300", "0.5", "1 2", "", "9" * 40)


def damaged_words(content: bytes, rng: np.random.Generator) -> bytes:
    """A copy of a text with a few words or numbers exchanged, or lines lost, doubled or moved; half are any damage."""
    if rng.random() < 0.3:
        return damaged(content, rng)
    text = content.decode("utf-8")
    for _ in range(int(rng.choice([1, 1, 2, 4]))):
        lines, words = text.splitlines(keepends=True), list(_WORD.finditer(text))
        if lines and rng.random() < 0.3:
            at, to = (int(rng.integers(len(lines))) for _ in range(2))
            lines[to:to] = lines[at : at + 1]
            del lines[at : at + int(rng.integers(3))]
            text = "".join(lines)
        elif words:
            numbers = [word for word in words if word[0][-1].isdigit()]
            wanted = numbers if numbers and rng.random() < 0.6 else words
            at = wanted[int(rng.integers(len(wanted)))]
            numeric = at[0][-1].isdigit() and rng.random() < 0.8
            choice = _NUMBERS if numeric else [word[0] for word in words]
            text = text[: at.start()] + choice[int(rng.integers(len(choice)))] + text[at.end() :]
    return text.encode()


def damaged_messages(content: bytes, rng: np.random.Generator) -> bytes:
    """A copy of an uncompressed bag with a number of one message, or of each, replaced; some are any damage."""
    if rng.random() < 0.2:
        return damaged(content, rng)
    data, starts = bytearray(content), [m.start() for m in re.finditer(rb"\x00\x01\x00\x00", content)]
    for _ in range(int(rng.choice([1, 1, 2, 4]))):
        offset, every = 4 + 4 * int(rng.integers(80)), rng.random() < 0.5
        value = int(rng.choice([0, 1, 2, 3, 5, 7, 0x7FF00000, 0x7FF80000, 0xFFFFFFFF, 0x7FFFFFFF]))
        for at in starts if every else rng.choice(starts, 1):
            data[at + offset : at + offset + 4] = struct.pack("<I", value)[: max(len(data) - at - offset, 0)]
    return bytes(data)


def _written(words: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(words, encoding="utf-8")


def _copy(model: str) -> Callable[[Path], object]:
    return lambda path: shutil.copyfile(MODELS / model, path)


def _estimate(path: Path) -> None:
    mocobot.estimate(mocobot.simulate("b", "static")).write(path)


def _joint_map(path: Path) -> None:
    model = load_model(MODELS / "xl330" / "xl330.xml")
    read_joint_map(path, model.joints, [bool(slide) for slide in model.slides])


def _effect(path: Path) -> None:
    """A word of the command line, which is no file: a refusal names it by itself."""
    try:
        parse_effect(path.read_bytes().decode("utf-8", "backslashreplace"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


CHAIN = ("phi1", "phi2", "phi3", "gimbal_z", "gimbal_y", "gimbal_x")
"""Joints that a bag of one robot names."""


def _joint_states(path: Path) -> None:
    write_bag(small_recording(200, 1), path, storage="sqlite3")


def _joint_columns(path: Path) -> None:
    """Columns as a well-known driver names them."""
    recording = small_recording(200, 1)
    columns = {"timestamp": recording.time}
    for name, values in (
        ("actual_q", recording.phi),
        ("actual_qd", recording.theta),
        ("actual_current", recording.tau),
    ):
        columns |= {f"{name}_{j}": np.round(values[:, 0, j], 6) for j in range(3)}
    pcsv.write_csv(pa.table(columns), path)


def _drafted(joints: tuple[str, ...]) -> Callable[[Path], None]:
    """Draft a map of a log, and read and inspect the log by it."""

    def read(path: Path) -> None:
        links = "".join(
            f'<body pos="0 0 .1"><joint name="{joint}" axis="{k % 2} {1 - k % 2} 0"/>'
            '<inertial pos="0 0 .05" mass="1" diaginertia=".01 .01 .01"/>'
            for k, joint in enumerate(joints)
        )
        model = path.with_name("robot.xml")
        model.write_text(f"<mujoco><worldbody>{links}{'</body>' * len(joints)}</worldbody></mujoco>")
        draft = draft_joint_map(path, joints, [False] * len(joints))
        if not draft.missing:
            log_map = path.with_name("drafted.toml")
            log_map.write_text(draft.text, encoding="utf-8")
            mocobot.inspect(path, model=model, map=log_map).to_dict()

    return read


def _locked(path: Path) -> None:
    """Options of the command line, which are no file: a base, and joints to lock."""
    base, *locks = path.read_bytes().decode("utf-8", "backslashreplace").split("\n")
    model = path.with_name("robot.urdf")
    model.write_text(URDF)
    try:
        load_model(model, [text for text in locks if text], base or None)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _link(name: str, inertial: bool = True, more: str = "") -> str:
    own = '<origin xyz="0 0 .1" rpy="0.1 0 0"/>\n<mass value="1.2"/>\n'
    own += '<inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.01"/>'
    return f'<link name="{name}">\n{f"<inertial>{own}</inertial>" if inertial else ""}\n{more}</link>\n'


def _joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}">\n<parent link="{parent}"/>\n<child link="{child}"/>\n'
        f'<origin xyz="0 0 0.3" rpy="0 0.1 0"/>\n<axis xyz="0 1 0"/>\n{more}</joint>\n'
    )


_LIMIT = '<limit lower="-2" upper="2" effort="50" velocity="3"/>\n<dynamics damping="0.1" friction="0.2"/>\n'
URDF = (
    '<robot name="arm">\n'
    + _link("base", inertial=False)
    + _link("upper", more='<collision><geometry><box size=".1 .1 .3"/></geometry></collision>\n')
    + _link("fore", more='<visual><geometry><mesh filename="package://arm/fore.stl"/></geometry></visual>\n')
    + _link("hand", inertial=False)
    + _link("left")
    + _link("right")
    + _joint("shoulder", "revolute", "base", "upper", _LIMIT)
    + _joint("elbow", "continuous", "upper", "fore")
    + _joint("wrist", "fixed", "fore", "hand")
    + _joint("jaw", "prismatic", "hand", "left", '<limit lower="0" upper="0.04" effort="9" velocity="1"/>\n')
    + _joint(
        "jaw2", "prismatic", "hand", "right", '<mimic joint="jaw" multiplier="-1" offset="0"/>\n' + _LIMIT
    )
    + "</robot>\n"
)
LOCKS = "upper\nelbow=90deg\njaw=0.02 m\n"
UNITS = json.dumps({"as_built": [{"phi_zero_rad": [0.01, 0, 0]}, {}, {}]})
KINDS = {
    "units": Kind("units.json", _written(UNITS), read_units),
    "options": Kind(
        "options.toml", _written(OPTIONS), lambda path: with_config(["simulate", "--config", str(path)])
    ),
    "effect": Kind("effect.txt", _written(EXAMPLE), _effect),
    "tolerances": Kind("tolerances.toml", _written(TOLERANCES), read_tolerances),
    "payload": Kind(
        "payload.xml", _copy("payload_c/payload.xml"), lambda path: grasp_frames(load_payload(path), str(path))
    ),
    "arm": Kind("arm.xml", _copy("xl330/xl330.xml"), load_model),
    "map of an arm": Kind("arm.toml", _copy("xl330/log.toml"), _joint_map),
    "estimate": Kind("estimate.json", _estimate, lambda path: compare(path, path)),
    "URDF": Kind("robot.urdf", _written(URDF), load_model, damaged_words),
    "words of a map": Kind("arm.toml", _copy("xl330/log.toml"), _joint_map, damaged_words),
    "locks": Kind("locks.txt", _written(LOCKS), _locked, damaged_words),
    "joint states": Kind("log.db3", _joint_states, _drafted(CHAIN), damaged_messages),
    "joint columns": Kind("log.csv", _joint_columns, _drafted(("a", "b", "c")), damaged_words),
}  # fmt: skip


LONGEST_S = 20
MOST_BYTES = 1 << 30
"""A damaged log of some hundred kilobytes must not make its reader take more than this."""


@dataclass(frozen=True)
class Outcome:
    """What became of one damaged log.

    Attributes:
        kind, seed: which log, and which damage.
        result: read, refused, or one of the faults: ``raised`` (not an InputError), ``untidy`` (a refusal that is no
            sentence that names the log), ``hung``, ``swollen`` (in memory).
        detail: what was said, or the traceback.
        seconds: wall time.
    """

    kind: str
    seed: int
    result: Literal["read", "refused", "raised", "untidy", "hung", "swollen", "died"]
    detail: str
    seconds: float = 0.0

    @property
    def is_fault(self) -> bool:
        """Whether the reader did what it must not."""
        return self.result not in ("read", "refused")


def check_original(kind: str, log: Path) -> None:
    """Check that a log is read as long as it is not damaged.

    Raises:
        RuntimeError: it is not.
    """
    if (done := _read(kind, log))[0] != "read":
        raise RuntimeError(f"a good log of kind {kind!r} is {done[0]}: {done[1]}")


def try_damaged(kind: str, log: Path, file: Path, content: bytes, seed: int) -> Outcome:
    """Damage a file of a log, read the log, and put the file back.

    Args:
        kind: one of ``originals.FORMATS`` or ``of_commands.KINDS``.
        log: the log as a user would name it.
        file: the file in it to damage.
        content: what the file holds when it is good.
        seed: of the damage.
    """
    damage = KINDS[kind].damage if kind in KINDS else damaged
    file.write_bytes(damage(content, np.random.default_rng(seed)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    try:
        with _alarm(), warnings.catch_warnings():
            warnings.simplefilter("error")
            result, detail = _read(kind, log)
    except TimeoutError:
        result, detail = "hung", f"after {LONGEST_S} s"
    finally:
        file.write_bytes(content)
    seconds = time.perf_counter() - start
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if grown > MOST_BYTES:
        result, detail = "swollen", f"by {grown / 2**20:.0f} MiB ({detail})"
    return Outcome(kind, seed, result, detail, seconds)


def _read(kind: str, log: Path) -> tuple[Literal["read", "refused", "raised", "untidy"], str]:
    try:
        if kind in KINDS:
            KINDS[kind].read(log)
        elif kind == "map":
            read_map(log)
        else:
            collect(open_log(log))
    except InputError as error:
        message = str(error)
        tidy = str(log) in message and message.isprintable() and len(message) < 2000
        return ("refused" if tidy else "untidy"), message
    except TimeoutError:
        raise
    except BaseException:  # whatever it is, the user would have seen it
        return "raised", traceback.format_exc()
    return "read", ""


@contextmanager
def _alarm() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError

    old = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, old)
