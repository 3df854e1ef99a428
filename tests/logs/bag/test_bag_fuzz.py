"""Damaged bags of the kinds in which damage goes deep: no checksums, no compression, no index; and damaged messages."""

import resource
import time
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

import bags
from bags import NO_SUMMARY, UNCHUNKED, Team, raw_mcap, rosbags_bag
from estimator.errors import InputError
from fuzzing import damaged
from mocobot_logs.bag.read import open_bag
from mocobot_logs.log import collect

RUNS = 60
TEAM = Team.draw(robots=2, rows=40)
MESSAGES = TEAM.said()


def chunked(path: Path, content: bytes) -> Path:
    """A file whose only chunk holds ``content``, checksum and index in order."""
    head = b"".join(
        [
            bytes(16),
            len(content).to_bytes(8, "little"),
            zlib.crc32(content).to_bytes(4, "little"),
            bytes(4),
            len(content).to_bytes(8, "little"),
        ]
    )
    tail = bags.record(Opcode.DATA_END, bytes(4)) + bags.record(Opcode.FOOTER, bytes(20))
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(
        magic
        + bags.record(Opcode.HEADER, bytes(8))
        + bags.record(Opcode.CHUNK, head + content)
        + tail
        + magic
    )
    return path


def inside(tmp_path: Path) -> bytes:
    """What lies between header and end of a file without chunks."""
    content = raw_mcap(tmp_path / "inside.mcap", MESSAGES, **NO_SUMMARY).read_bytes()
    begin = 8 + 9 + int.from_bytes(content[9:17], "little")
    return content[begin : content.rindex(bags.record(Opcode.DATA_END, bytes(4)))]


def outcome(path: Path) -> str:
    """``read``, or what the refusal says; anything else goes through."""
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            collect(open_bag(path))
            said = "read"
        except InputError as error:
            said = str(error)
            assert str(path) in said
            assert said.isprintable()
            assert len(said) < 2000
    assert time.perf_counter() - begin < 10.0
    return said


def assert_sound(path: Path, write, seed: int, runs: int = RUNS) -> None:
    """``write(rng)`` puts a damaged bag at ``path``."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said = []
    for k in range(runs):
        write(np.random.default_rng([seed, k]))
        said.append(outcome(path))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 600_000  # kB
    refused = [text for text in said if text != "read"]
    assert len(refused) > runs / 10
    assert len(set(refused)) > 1


@pytest.mark.parametrize("options", [{"enable_crcs": False}, UNCHUNKED, NO_SUMMARY, {}], ids=range(4))
def test_damaged_mcap_files(tmp_path, options):
    path = raw_mcap(tmp_path / "a.mcap", MESSAGES, **options)
    content = path.read_bytes()
    assert outcome(path) == "read"
    assert_sound(path, lambda rng: path.write_bytes(damaged(content, rng)), 1)


def test_damaged_records_in_a_sound_chunk(tmp_path):
    path, content = tmp_path / "a.mcap", inside(tmp_path)
    assert outcome(chunked(path, content)) == "read"
    assert_sound(path, lambda rng: chunked(path, damaged(content, rng)), 2)


def test_damaged_messages_in_a_sound_file(tmp_path):
    path = tmp_path / "a.mcap"

    def write(rng):
        spoiled = [
            bags.Said(s.topic, s.log_ns, s.kind, damaged(s.data, rng) if rng.random() < 0.05 else s.data)
            for s in MESSAGES
        ]
        raw_mcap(path, spoiled, enable_crcs=False)

    assert_sound(path, write, 3)


def test_damaged_definitions_in_a_sound_file(tmp_path):
    path, text = tmp_path / "a.mcap", bags.definition(bags.JOINT_STATE).encode()

    def write(rng):
        spoiled = damaged(text, rng).decode(errors="replace")
        raw_mcap(path, MESSAGES, definitions={bags.JOINT_STATE: ("ros2msg", spoiled)})

    assert_sound(path, write, 4)


def test_damaged_databases(tmp_path):
    path = rosbags_bag(tmp_path / "bag", MESSAGES, "sqlite3") / "bag.db3"
    content = path.read_bytes()
    assert_sound(path, lambda rng: path.write_bytes(damaged(content, rng)), 5)


@pytest.mark.parametrize("compression", ["file", "message"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_damaged_compressed_bags(tmp_path, compression, storage):
    folder = rosbags_bag(tmp_path / "bag", MESSAGES, storage, compression)
    (path,) = (entry for entry in folder.iterdir() if entry.suffix != ".yaml")
    content = path.read_bytes()

    def write(rng):
        path.write_bytes(damaged(content, rng))

    assert outcome(folder) == "read"
    assert_sound(folder, write, 6, RUNS // 2)


def test_damaged_metadata(tmp_path):
    folder = rosbags_bag(tmp_path / "bag", MESSAGES, "sqlite3")
    path = folder / "metadata.yaml"
    content = path.read_bytes()
    assert_sound(folder, lambda rng: path.write_bytes(damaged(content, rng)), 7)
