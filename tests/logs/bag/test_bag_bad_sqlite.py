"""SQLite files that are no bags, or were made to harm."""

import sqlite3

import pytest

from bag_refusals import TEAM, refuses
from bags import Team, rosbags_bag


def change_db3(tmp_path, *statements):
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3") / "bag.db3"
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(*statement if isinstance(statement, tuple) else (statement,))
    connection.commit()
    connection.close()
    return path


DEFINED = "message_definitions"
OMNID2 = "topic /omnid2/joint/joint_states has no messages"
ENDLESS = (
    "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
    "SELECT id, 1 AS topic_id, id AS timestamp, x'00010000' AS data FROM n"
)


@pytest.mark.parametrize(
    ("statements", "match"),
    [
        (["DROP TABLE messages"], "not a bag, the SQLite file has no table 'messages'"),
        (["DROP TABLE topics"], "not a bag, the SQLite file has no table 'topics'"),
        (["DROP TABLE messages", ENDLESS], "not a bag, the SQLite file has no table 'messages'"),
        (["ALTER TABLE messages RENAME COLUMN data TO content"], "its table 'messages' has no column 'data'"),
        (["UPDATE topics SET name = x'00ff'"], "its table 'topics' has a row"),
        (["UPDATE messages SET data = NULL WHERE id = 7"], "NOT NULL|without data"),
        (["UPDATE messages SET data = 'text' WHERE id = 7"], "'messages' has a row that holds no message"),
        (["UPDATE messages SET data = 3 WHERE id = 7"], "has a row without data"),
        (["UPDATE messages SET timestamp = 'noon' WHERE id = 7"], "has a row that holds no message"),
        (["UPDATE messages SET data = x'00010000' WHERE id = 7"], r"is not a readable .*: it has 4 bytes, 4 less"),
        (["UPDATE messages SET data = zeroblob(17000000) WHERE id = 7"], "a message of (more than 16|16.2) MiB"),
        (["DELETE FROM messages"], "topic /omnid1/joint/joint_states has no message"),
        (["DELETE FROM messages WHERE topic_id = (SELECT id FROM topics WHERE name LIKE '/omnid2%')"], OMNID2),
        (["DELETE FROM topics"], "the bag has no topics"),
        (["UPDATE topics SET serialization_format = 'json'"], "is encoded as 'json'; only cdr, as ROS 2"),
        ([f"UPDATE {DEFINED} SET encoding = 'proto'"], "its type is defined by 'proto'; ros2msg and ros2idl"),
        ([f"UPDATE {DEFINED} SET encoded_message_definition = 'float64 [['"], "the definition of its type .* is not"),
        (["INSERT INTO topics SELECT 9, name, 'lab/msg/A', 'cdr', '', '' FROM topics WHERE id = 1"], "holds both"),
    ],
    ids=range(18),
)  # fmt: skip
def test_databases_made_to_fail(tmp_path, statements, match):
    if "NULL" in statements[0] and "UPDATE" in statements[0]:
        statements = [
            "ALTER TABLE messages RENAME TO old",
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)",
            "INSERT INTO messages SELECT * FROM old",
            *statements,
        ]
    refuses(change_db3(tmp_path, *statements), match)


def test_a_database_whose_pages_repeat(tmp_path):
    """Every page of the messages' tree stands for the first one: each row comes many times."""
    path = rosbags_bag(tmp_path / "bag", Team.draw(rows=400).said(), "sqlite3") / "bag.db3"
    content = bytearray(path.read_bytes())
    connection = sqlite3.connect(path)
    (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    connection.close()
    page = (root - 1) * 4096
    assert content[page] == 5  # an inner page of a table
    cells = int.from_bytes(content[page + 3 : page + 5], "big")
    first = None
    for k in range(cells):
        at = page + int.from_bytes(content[page + 12 + 2 * k : page + 14 + 2 * k], "big")
        first = first or content[at : at + 4]
        content[at : at + 4] = first
    path.write_bytes(content)
    refuses(path, "damaged, (its table 'messages' holds the same row twice|or not a bag)")


def test_a_message_whose_pages_run_in_a_circle(tmp_path):
    """A small file claims a message of 100 MB: its last page names itself as the next one."""
    path = rosbags_bag(tmp_path / "bag", Team.draw(robots=1, rows=5).said(), "sqlite3") / "bag.db3"
    connection = sqlite3.connect(path)
    (pages,) = connection.execute("PRAGMA page_count").fetchone()
    connection.execute("UPDATE messages SET data = zeroblob(100000000) WHERE id = 3")
    connection.commit()
    connection.close()
    with path.open("r+b") as file:
        content = bytearray(file.read((pages + 4) * 4096))
        content[-4096:-4092] = content[28:32] = (pages + 4).to_bytes(4, "big")
        file.truncate(0)
        file.seek(0)
        file.write(content)
    refuses(path, "a message of more than 16 MiB|disk image is malformed")
