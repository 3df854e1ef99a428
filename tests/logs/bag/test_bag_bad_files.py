"""Paths that are no bags, metadata.yaml that lies or harms, files cut off, and bombs: one sentence each."""

import os

import pytest
import zstandard

import bags
from bag_refusals import TEAM, refuses
from bags import raw_mcap, rosbags_bag
from mocobot_logs.bag.read import open_bag
from mocobot_logs.formats import is_bag
from mocobot_logs.log import collect


def test_paths_that_are_no_bags(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "notes.db3").write_text("notes")
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    os.mkfifo(tmp_path / "pipe.mcap")
    refuses(tmp_path / "none", "there is no such file or folder")
    refuses(tmp_path / ("n" * 300), "not a usable file name|no such file")
    refuses(tmp_path / "empty", r"is a folder without a bag \(metadata.yaml and .mcap or .db3 files\)")
    refuses(tmp_path / "notes.txt", "is neither an MCAP nor an SQLite file")
    refuses(tmp_path / "empty.mcap", "empty.mcap: is empty")
    refuses(tmp_path / "notes.db3", "is neither an MCAP nor an SQLite file")
    refuses(tmp_path / "old.bag", "a bag of ROS 1; `rosbags-convert` makes a ROS 2 bag of it")
    refuses(tmp_path / "pipe.mcap", "is not a regular file")
    meant = {"empty": False, "notes.txt": False, "empty.mcap": True, "notes.db3": True, "old.bag": True}
    for name, is_meant in {**meant, "pipe.mcap": False, "none": False, "n" * 300: False}.items():
        assert is_bag(tmp_path / name) == is_meant, name


def metadata_case(tmp_path, change, match):
    path = rosbags_bag(tmp_path / "bag", TEAM.said())
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    changed = change(told) if callable(change) else change
    assert changed != told
    yaml.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
    refuses(path, match)


LISTED = "  relative_file_paths:\n  - bag.mcap\n"
DEEP = "[" * 20_000
LAUGHS = "a: &a [x,x,x]\n" + "".join(
    f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefghij", "bcdefghijk", strict=True)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{b}: &{b}\n  <<: [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefghij", "bcdefghijk", strict=True)
)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ("", r"has no table 'rosbag2_bagfile_information'"),
        ("[1, 2]", r"has no table 'rosbag2_bagfile_information'"),
        ("rosbag2_bagfile_information: 3", r"has no table 'rosbag2_bagfile_information'"),
        ("a: [", r"metadata.yaml: not readable YAML"),
        (b"\0\xff\xfe" * 100, r"metadata.yaml: not readable YAML"),
        (DEEP, r"holds YAML beyond plain values"),
        (LAUGHS, r"it has anchors"),
        (MERGES, r"holds YAML beyond plain values"),
        ("a: !!python/object/apply:os.system [ls]", r"holds YAML beyond plain values"),
        ("#" * 2_000_000, r"is larger than 1 MiB"),
        (lambda s: s.replace("version: 9", "version: 77"), r"version is 77; bags of versions 1 to 9 are read"),
        (lambda s: s.replace("version: 9", "version: nine"), r"version is 'nine'"),
        (lambda s: s.replace("identifier: mcap", "identifier: rocks"), r"is 'rocks'; it must be one of mcap, sq"),
        (lambda s: s.replace("mode: ''", "mode: cube"), r"compression_mode is 'cube'; it must be one of none, file"),
        (lambda s: s.replace("mode: ''", "mode: FILE"), r"compression_format is ''; it must be one of zstd"),
        (lambda s: s.replace(LISTED, ""), r"relative_file_paths is None; it must list the bag's files"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: []\n"), r"relative_file_paths is \[\]; it must list"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: [3]\n"), r"relative_file_paths is \[3\]; it must list"),
        (lambda s: s.replace(LISTED, LISTED + "  - bag.mcap\n"), r"each must be another file in the folder"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: ['..']\n"), r"each must be another file in the folder"),
        (lambda s: s.replace(LISTED, LISTED + "  - bag_1.mcap\n"), r"bag_1.mcap: there is no such file, though"),
        (lambda s: s.replace(LISTED, LISTED + "  - /etc/passwd\n"), r"bag/passwd: there is no such file, though"),
        (lambda s: s.replace(LISTED, LISTED + "  - metadata.yaml\n"), r"metadata.yaml: is neither an MCAP"),
    ],
    ids=range(23),
)  # fmt: skip
def test_metadata_that_cannot_be_used(tmp_path, change, match):
    metadata_case(tmp_path, change, match)


def test_metadata_that_lies_about_what_does_not_matter(tmp_path):
    """Counts, times and topics are taken from the files."""
    path = rosbags_bag(tmp_path / "bag", TEAM.said())
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    for old, new in (
        ("message_count: 20", "message_count: 999999999999"),
        ("nanoseconds: ", "nanoseconds: 7"),
        ("name: /omnid1", "name: /robot7"),
        ("storage_identifier: mcap", "storage_identifier: sqlite3"),
    ):
        assert old in told
        told = told.replace(old, new)
    yaml.write_text(told)
    assert collect(open_bag(path)).streams[0].values.tolist() == TEAM.wrist(0).tolist()


def test_no_metadata(tmp_path):
    path = rosbags_bag(tmp_path / "bag", TEAM.said())
    (path / "metadata.yaml").unlink()
    assert is_bag(path)
    refuses(
        path,
        r"bag: has no metadata.yaml; `ros2 bag reindex` writes it, or name a single file such as .*bag.mcap",
    )
    (path / "metadata.yaml").mkdir()
    refuses(path, r"bag: has no metadata.yaml")


def test_mcap_files_that_are_cut_off(tmp_path):
    content = raw_mcap(tmp_path / "whole.mcap", TEAM.said()).read_bytes()
    path = tmp_path / "a.mcap"
    for length in [
        *range(1, 40, 3),
        len(content) // 2,
        len(content) - 40,
        len(content) - 9,
        len(content) - 1,
    ]:
        path.write_bytes(content[:length])
        refuses(
            path,
            "cut off, the MCAP file has no end; .*`mcap recover` saves" if length >= 8 else "neither an MCAP",
        )


def test_sqlite_files_that_are_cut_off(tmp_path):
    content = (rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3") / "bag.db3").read_bytes()
    path = tmp_path / "a.db3"
    for length in [16, 50, 99, 100, 4096, len(content) - 4096, len(content) - 1]:
        path.write_bytes(content[:length])
        refuses(path, rf"cut off, the SQLite file has {length} of \d+ bytes")


def test_a_recording_that_was_not_closed(tmp_path):
    """A crashed recorder leaves what it wrote last beside the file."""
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3") / "bag.db3"
    for suffix in ("-wal", "-journal"):
        side = path.with_name(path.name + suffix)
        side.write_bytes(b"pages")
        refuses(
            path,
            rf"its recording was not closed, bag.db3{suffix} holds a part of it; `sqlite3 bag.db3 'PRAGMA",
        )
        side.write_bytes(b"")
        assert collect(open_bag(path)).robots == 3
        side.unlink()
    assert [entry.name for entry in path.parent.iterdir() if entry.suffix != ".yaml"] == ["bag.db3"]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bombs_in_compressed_files_and_messages(tmp_path, storage):
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), storage, "file")
    (packed,) = (entry for entry in path.iterdir() if entry.suffix == ".zstd")
    content = zstandard.ZstdDecompressor().decompressobj().decompress(packed.read_bytes())
    packed.write_bytes(zstandard.compress(bytes(1 << 28)))
    refuses(packed, "what it unpacks to is neither an MCAP nor an SQLite file")
    packed.write_bytes(zstandard.compress(content + bytes((1 << 28) + 1)))
    refuses(packed, "unpacks to at least 0.25.* GiB; the limit is 0.25 GiB, which --max-unpacked GIB changes")
    packed.write_bytes(zstandard.compress(content)[:-1000])
    refuses(packed, "cut off|unpacks to nothing|damaged")
    packed.write_bytes(zstandard.compress(b""))
    refuses(packed, "unpacks to nothing, or is cut off")
    packed.write_bytes(zstandard.compress(content)[:40] + bytes(100))
    refuses(packed, "damaged|unpacks to nothing")
    bomb = zstandard.compress(bytes(1 << 25))
    messages = [bags.Said(s.topic, s.log_ns, s.kind, bomb) for s in TEAM.said()]
    path = rosbags_bag(tmp_path / "more", messages, storage)
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    yaml.write_text(
        told.replace("compression_mode: ''", "compression_mode: MESSAGE").replace(
            "format: ''", "format: zstd"
        )
    )
    assert yaml.read_text().count("zstd") == 1
    refuses(path, "damaged, a compressed message unpacks to more than 16 MiB")
    path = rosbags_bag(tmp_path / "most", TEAM.said(), storage)
    (path / "metadata.yaml").write_text(yaml.read_text().replace("more", "most"))
    refuses(path, "damaged, a compressed message does not unpack")


def test_temporary_copies_go(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3", "file")
    source = open_bag(path)
    assert len(list((tmp_path / "tmp").iterdir())) == 1
    collect(source)
    del source
    assert not list((tmp_path / "tmp").iterdir())
    (tmp_path / "tmp").rmdir()
    refuses(path, "cannot be unpacked, there is no temporary folder")
