"""MCAP files made to fail: claims of ten gigabytes, bombs, and records that do not fit together."""

import struct
import time

import pytest
import zstandard
from mcap.opcode import Opcode

import bags
from bag_refusals import TEAM, refuses
from bags import EPOCH_NS, record
from mocobot_logs.bag.read import open_bag
from mocobot_logs.log import collect

MAGIC = b"\x89MCAP0\r\n"


def mcap_of(*records, end=True):
    tail = record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20)) if end else b""
    head = record(Opcode.HEADER, struct.pack("<I4sI", 4, b"ros2", 0))
    return MAGIC + head + b"".join(records) + tail + MAGIC


def text(value: bytes):
    return struct.pack("<I", len(value)) + value


SCHEMA = record(
    Opcode.SCHEMA,
    struct.pack("<H", 1)
    + text(bags.JOINT_STATE.encode())
    + text(b"ros2msg")
    + text(bags.definition(bags.JOINT_STATE).encode()),
)


def channel(number=1, schema=1, topic=b"/omnid1/joint/joint_states", encoding=b"cdr"):
    return record(
        Opcode.CHANNEL, struct.pack("<HH", number, schema) + text(topic) + text(encoding) + text(b"")
    )


def message(data=None, number=1, log=EPOCH_NS, claim=None):
    data = bags.cdr(TEAM.message(0, 0)) if data is None else data
    content = struct.pack("<HIQQ", number, 0, log, log) + data
    return record(Opcode.MESSAGE, content, claim)


def chunk(content, compression=b"", size=None, crc=0, stored=None):
    held = stored if stored is not None else content
    head = struct.pack("<QQQI", 0, 0, len(content) if size is None else size, crc)
    return record(Opcode.CHUNK, head + text(compression) + struct.pack("<Q", len(held)) + held)


GOOD = SCHEMA + channel() + message()


def test_files_made_by_hand_are_read(tmp_path):
    """So that the ones below are refused for what is wrong with them."""
    path = tmp_path / "a.mcap"
    private = record(0x93, b"whatever")
    for records in ((GOOD,), (chunk(GOOD),), (private, chunk(private + GOOD + private), private)):
        path.write_bytes(mcap_of(*records))
        assert collect(open_bag(path)).streams[0].values.tolist() == TEAM.wrist(0)[:1].tolist()


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (mcap_of(GOOD, end=False), "where the footer should be"),
        (MAGIC + record(2, bytes(20))[:9] + struct.pack("<QQI", 10**15, 0, 0) + MAGIC, "the footer says that the summ"),
        (mcap_of(GOOD, record(Opcode.CHUNK, b"", 10_000_000_000)), r"claims 10000000000 bytes, of which \d+ are"),
        (mcap_of(GOOD, record(Opcode.ATTACHMENT, b"", 2**64 - 1)), r"a record claims 18446744073709551615 bytes"),
        (mcap_of(SCHEMA + channel(), message(claim=10_000_000_000)), r"a record claims 10000000000 bytes"),
        (mcap_of(chunk(SCHEMA + channel() + message(claim=10_000_000_000))), r"a message is longer than what holds it"),
        (mcap_of(chunk(SCHEMA + channel() + message(claim=2**64 - 1))), r"a message is longer than what holds it"),
        (mcap_of(chunk(SCHEMA + channel() + record(Opcode.MESSAGE, b"x"))), r"kind 5 and 1 bytes, which cannot be"),
        (mcap_of(chunk(SCHEMA + channel() + message(b"", claim=3))), r"claims"),
        (mcap_of(chunk(GOOD + b"\1\2")), r"a record is cut off"),
        (mcap_of(chunk(GOOD, size=10_000_000_000)), r"the chunk claims 10000000000 bytes; chunks of at most 256 MiB"),
        (mcap_of(chunk(GOOD, b"zstd", 10_000_000_000, stored=zstandard.compress(GOOD))), r"claims 10000000000 bytes"),
        (mcap_of(chunk(GOOD, size=5)), r"the chunk claims 5 bytes unpacked, but holds more"),
        (mcap_of(chunk(GOOD, b"zstd", 5, stored=zstandard.compress(GOOD))), r"claims 5 bytes unpacked, but holds more"),
        (mcap_of(chunk(GOOD, b"zstd", 5000, stored=zstandard.compress(GOOD))), r"claims 5000 bytes unpacked, but ho"),
        (mcap_of(chunk(GOOD, b"zstd", stored=b"no frame")), r"the chunk does not unpack"),
        (mcap_of(chunk(GOOD, b"lz4", stored=b"no frame")), r"the chunk does not unpack"),
        (mcap_of(chunk(GOOD, b"lz4", stored=b"")), r"the chunk is cut off"),
        (mcap_of(chunk(GOOD, b"xz")), r"the chunk is compressed by 'xz'; it must be zstd, lz4 or not compressed"),
        (mcap_of(chunk(GOOD, crc=7)), r"the chunk's checksum does not agree"),
        (mcap_of(chunk(chunk(GOOD))), r"a record of kind 6 and \d+ bytes, which cannot be"),
        (mcap_of(chunk(bytes(1000))), r"a record of kind 0 and 0 bytes, which cannot be"),
        (mcap_of(record(0, b"")), r"a record of no kind"),
        (mcap_of(record(Opcode.CHUNK, bytes(30))), r"a chunk of 30 bytes"),
        (mcap_of(record(Opcode.CHUNK, bytes(28) + struct.pack("<I", 10**9) + bytes(40))), r"more bytes than it has"),
        (mcap_of(channel() + message()), r"channel 1 has schema 1, which is missing"),
        (mcap_of(SCHEMA + message()), r"a message of channel 1, which was not announced"),
        (mcap_of(GOOD, channel(topic=b"/other")), r"channel 1 is defined twice"),
        (mcap_of(GOOD, SCHEMA.replace(b"effort", b"torque")), r"schema 1 is defined twice"),
        (mcap_of(record(Opcode.SCHEMA, b"x") + GOOD), r"its Schema record is not readable"),
        (mcap_of(SCHEMA, record(Opcode.CHANNEL, struct.pack("<HHI", 1, 1, 2**32 - 1)), GOOD), r"its Channel record is"),
        (mcap_of(SCHEMA, channel(topic=b"\xff\xfe"), GOOD), r"its Channel record is not readable"),
        (mcap_of(SCHEMA + channel(), message(log=2**63)), r"was logged after the year 2262"),
        (mcap_of(SCHEMA + channel() + channel(2, 0), message()), r"holds both 'sensor_msgs/msg/JointState' and ''"),
        (mcap_of(SCHEMA + channel()), r"topic /omnid1/joint/joint_states has no message"),
        (mcap_of(), r"no topic '/omnid1/joint/joint_states' for h_x .* the bag has no topics"),
    ],
    ids=range(36),
)  # fmt: skip
def test_mcap_files_made_to_fail(tmp_path, content, match):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    refuses(path, match)


def test_a_bomb_in_a_chunk(tmp_path):
    """A gigabyte of zeros in 100 kB, told and not told; and a chunk that is as large as one may be."""
    zeros = zstandard.ZstdCompressor().compress(bytes(1 << 28))
    stream = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    untold = b"".join(stream.compress(bytes(1 << 24)) for _ in range(64)) + stream.flush()
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1 << 30, stored=untold)))
    refuses(path, "claims 1073741824 bytes; chunks of at most 256 MiB are read")
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1000, stored=untold)))
    refuses(path, "claims 1000 bytes unpacked, but holds more")
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1 << 28, stored=zeros)))
    refuses(path, "a record of kind 0 and 0 bytes, which cannot be")


def test_loose_records_between_tiny_chunks(tmp_path):
    """Windows of the file are read for loose records; chunks between them must not make that slow."""
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap_of(SCHEMA, channel(), *[message() + chunk(message())] * 3000))
    begin = time.perf_counter()
    assert len(collect(open_bag(path)).streams[0].values) == 6000
    assert time.perf_counter() - begin < 15.0
