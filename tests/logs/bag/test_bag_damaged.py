"""CDR messages of any type against another serialiser, and bags with damaged bytes: sound samples or one sentence."""

import resource
import struct
import time
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import bags
from bags import EPOCH_NS, NO_SUMMARY, OMNID, UNCHUNKED, Team, raw_mcap, rosbags_bag
from estimator.errors import InputError
from fuzzing import damaged
from mocobot_logs.bag.cdr import CdrReader, Selector, message_type
from mocobot_logs.bag.read import open_bag
from mocobot_logs.bag.storage import Topic, joined
from mocobot_logs.log import collect

RANGES = {
    "bool": (0, 1), "byte": (0, 127), "char": (0, 255), "int8": (-(2**7), 2**7 - 1), "uint8": (0, 2**8 - 1),
    "int16": (-(2**15), 2**15 - 1), "uint16": (0, 2**16 - 1), "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1), "int64": (-(2**53), 2**53), "uint64": (0, 2**53),
}  # fmt: skip
"""Of a byte, what rosbags packs; of long ones, what a float holds."""
NUMPY = {"bool": "bool", "byte": "uint8", "char": "uint8"}
SEPARATOR = "=" * 80 + "\n"


def messages(*payloads):
    numbers = np.arange(len(payloads), dtype=np.int64)
    return joined(payloads, numbers, "test")


def values_of(base):
    if base == "string":
        return st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
    if base.startswith("float"):
        return st.floats(width=int(base[5:]), allow_nan=False)
    return st.booleans() if base == "bool" else st.integers(*RANGES[base])


@st.composite
def structures(draw, depth=0):
    """A structure: fields as (type, how many of it: None, a number or '[]', values)."""
    fields = []
    for _ in range(draw(st.integers(1, 5))):
        base = draw(st.sampled_from([*RANGES, "float32", "float64", "float64", "string"]))
        nested = depth < 2 and draw(st.integers(0, 4)) == 0
        kind = draw(structures(depth + 1)) if nested else base
        how = draw(st.sampled_from([None, None, 1, 2, 3, "[]", "[]"]))
        count = how if isinstance(how, int) else draw(st.integers(0, 4)) if how else 1
        if nested:
            values = [draw(refilled(kind)) for _ in range(count)]
        else:
            values = draw(st.lists(values_of(base), min_size=count, max_size=count))
        fields.append((kind, how, values))
    return fields


@st.composite
def refilled(draw, structure):
    """The same types with the same number of values, but other values."""
    out = []
    for kind, how, values in structure:
        again = refilled(kind) if isinstance(kind, list) else values_of(kind)
        out.append((kind, how, [draw(again) for _ in values]))
    return out


def texts(structure, name="lab/msg/Root"):
    """Definitions by name."""
    lines, more = [], {}
    for k, (kind, how, _) in enumerate(structure):
        spelled = kind
        if isinstance(kind, list):
            spelled = f"{name.replace('/msg/', '/')}X{k}"
            more |= texts(kind, f"{name}X{k}")
        lines.append(f"{spelled}{'' if how is None else '[]' if how == '[]' else f'[{how}]'} f{k}")
    return {name: "\n".join(lines) + "\n", **more}


def build(store, structure, name="lab/msg/Root"):
    """The message object of rosbags."""
    fields = {}
    for k, (kind, how, values) in enumerate(structure):
        if isinstance(kind, list):
            made = [build(store, value, f"{name}X{k}") for value in values]
        elif kind == "string" or how is None:
            made = values
        else:
            made = np.array(values, NUMPY.get(kind, kind))
        fields[f"f{k}"] = made[0] if how is None else made
    return store.types[name](**fields)


def leaves(structure, path=""):
    """Dotted paths of all numbers, and the numbers."""
    for k, (kind, how, values) in enumerate(structure):
        for index, value in enumerate(values):
            here = f"{path}f{k}" + ("" if how is None else f"[{index}]")
            if isinstance(kind, list):
                yield from leaves(value, f"{here}.")
            elif kind != "string":
                yield here, float(value)


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(structures(), st.booleans())
def test_any_type(structure, little):
    told = texts(structure)
    root, *others = told.items()
    text = root[1] + "".join(f"{SEPARATOR}MSG: {name.replace('/msg/', '/')}\n{t}" for name, t in others)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, root[0]))
    payload = bytes(store.serialize_cdr(build(store, structure), root[0], little_endian=little))
    kind = message_type(Topic("/t", root[0], "cdr", "ros2msg", text), "bag")
    wanted = dict(leaves(structure))
    for path in wanted:
        kind.require(path)
    reader = CdrReader(kind, [Selector(path) for path in wanted], stamp=False)
    _, values = reader.read(messages(payload, payload + b"\0\0\0"))
    assert values.tolist() == [list(wanted.values())] * 2
    assert reader.lacking == [None] * len(wanted)
    for cut in range(0, len(payload), 1 + len(payload) // 20):
        with pytest.raises(
            InputError, match=r"message 2 is not a readable lab/msg/Root: it (has|is cut off|is empty)"
        ):
            reader.read(messages(payload[:cut]))


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(
    st.lists(st.text("abc", max_size=5), max_size=5),
    st.integers(0, 5),
    st.integers(0, 5),
    st.text("fr", max_size=9),
)
def test_joint_states_of_any_length(names, positions, efforts, frame):
    rng = np.random.default_rng(len(names))
    names = list(dict.fromkeys(names))
    message = bags.joint_state(
        rng.normal(size=positions), rng.normal(size=efforts), EPOCH_NS, names, frame=frame
    )
    payload = bags.cdr(message)
    decode = generate_dynamic(bags.JOINT_STATE, bags.definition(bags.JOINT_STATE))[bags.JOINT_STATE]
    theirs = decode(payload)
    kind = message_type(Topic("/t", bags.JOINT_STATE, "cdr"), "bag")
    reader = CdrReader(kind, [Selector(f, n) for f in ("position", "effort") for n in names], stamp=True)
    stamps, values = reader.read(messages(payload))
    assert stamps.tolist() == [theirs.header.stamp.sec * 10**9 + theirs.header.stamp.nanosec] == [EPOCH_NS]
    # JointState.msg: "All arrays in this message should have the same size, or be empty."
    want = [
        array if len(array) == len(names) else [np.nan] * len(names)
        for array in (theirs.position, theirs.effort)
    ]
    np.testing.assert_array_equal(values[0], np.ravel(want))
    assert tuple(reader.joints) == tuple(theirs.name if names else ())
    assert [lacking is not None for lacking in reader.lacking] == np.isnan(np.ravel(want)).tolist()


KIND = message_type(Topic("/t", bags.JOINT_STATE, "cdr"), "bag")


def joint_reader(*names):
    return CdrReader(KIND, [Selector("position", name) for name in names], stamp=True)


def test_layouts_are_told_apart_by_names_and_lengths():
    """Messages of one size whose joints are in another order, or whose numbers are in another array."""
    forth = bags.joint_state([1, 2], [3, 4], names=["aa", "bb"])
    back = bags.joint_state([5, 6], [7, 8], names=["bb", "aa"])
    other = bags.joint_state([9, 10, 11], [12], names=["aa", "bb"])  # whose they are is not known
    payloads = [bags.cdr(m) for m in (forth, back, other, forth)]
    assert len({*map(len, payloads)}) == 1
    reader = joint_reader("aa", "bb")
    _, values = reader.read(messages(*payloads))
    np.testing.assert_array_equal(values, [[1, 2], [6, 5], [np.nan, np.nan], [1, 2]])
    assert list(reader.joints) == ["aa", "bb"]


def test_thousands_of_layouts():
    """More than are kept, among as many messages of the same size."""
    rng = np.random.default_rng(8)
    payloads, want = [], []
    for _ in range(3000):
        order = rng.permutation(6)
        names = [f"{OMNID[0]}{k}" for k in order]
        position = rng.normal(size=6)
        payloads.append(bags.cdr(bags.joint_state(position, [], names=names)))
        want.append([position[list(order).index(2)], position[list(order).index(5)]])
    _, values = joint_reader("x2", "x5").read(messages(*payloads))
    np.testing.assert_array_equal(values, want)


def test_padding_may_hold_anything():
    """FastDDS leaves what was in memory between fields."""
    payload = bytearray(bags.cdr(bags.joint_state([1.0], [2.0], names=["abcd"])))
    at = payload.index(b"abcd\0") + 5
    assert payload[at : at + 3] == b"\0\0\0"
    dirty = bytes(payload[:at] + b"\xff\xfe\xfd" + payload[at + 3 :])
    reader = joint_reader("abcd")
    assert reader.read(messages(bytes(payload), dirty, bytes(payload)))[1].tolist() == [[1.0], [1.0], [1.0]]
    assert len(reader._layouts[len(payload)]) == 1


GOOD = bags.cdr(bags.joint_state([1.0, 2.0], [3.0, 4.0], names=["a", "b"]))
COUNT = 4 + 8 + 4 + 1 + 3  # encapsulation, stamp, empty frame, padding: the number of names


@pytest.mark.parametrize(
    ("payload", "what"),
    [
        (b"", "it is empty"),
        (b"\0\1\0", "it is cut off, at 3 bytes"),
        (GOOD[:-1], r"it has \d+ bytes, 1 less than its lengths say"),
        (GOOD[:30], r"less than its lengths say"),
        (b"\0\3" + GOOD[2:], r"its encapsulation is 0x0003 \(PL_CDR\); plain CDR \(0x0000, 0x0001\) is read"),
        (b"\0\7" + GOOD[2:], r"its encapsulation is 0x0007 \(CDR2\)"),
        (b"\0\x0b" + GOOD[2:], r"its encapsulation is 0x000b \(PL_CDR2\)"),
        (b"\x41\x41" + GOOD[2:], r"its encapsulation is 0x4141 \(an unknown one\)"),
        (b"\0\0" + GOOD[2:], "less than its lengths say"),  # the other byte order
        (GOOD[:COUNT] + struct.pack("<I", 2**32 - 1) + GOOD[COUNT + 4 :], "holds more than 10000 strings"),
        (GOOD[:12] + struct.pack("<I", 2**31) + GOOD[16:], "less than its lengths say"),  # a frame of 2 GiB
        (
            GOOD[:8] + struct.pack("<I", 10**9) + GOOD[12:],
            "nanoseconds of its stamp are 1000000000; they must be",
        ),
    ],
    ids=range(12),
)
def test_broken_messages(payload, what):
    assert joint_reader("a").read(messages(GOOD))[1].tolist() == [[1.0]]
    reader = joint_reader("a")
    with pytest.raises(
        InputError, match=rf"bag: topic /t: message 1 is not a readable {bags.JOINT_STATE}: .*{what}"
    ):
        reader.read(messages(GOOD, payload))


@pytest.mark.parametrize(("more", "unread"), [(3, 0), (4, 4), (8, 8)])
def test_bytes_after_the_last_field(more: int, unread: int):
    """Recorders in the field write them, and ROS 2 leaves them unread."""
    reader = joint_reader("a", "b")
    assert reader.read(messages(GOOD, GOOD + b"\1" * more))[1].tolist() == [[1.0, 2.0]] * 2
    assert reader.unread == unread


def test_a_sequence_of_ten_gigabytes():
    at = GOOD.index(struct.pack("<d", 1.0)) - 4
    claim = GOOD[:at] + struct.pack("<I", 1_250_000_000) + GOOD[at + 4 :]
    with pytest.raises(InputError, match=r"99999999\d\d less than its lengths say"):
        joint_reader("a").read(messages(claim))


def test_names_that_appear_twice():
    reader = joint_reader("a")
    reader.read(messages(bags.cdr(bags.joint_state([1, 2], [], names=["a", "a"]))))
    assert reader.lacking == ["is named more than once"]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("Root again\n", "holds itself, or is too deep"),
        ("float64 x\nOther y\n", "hold the type lab/msg/Other, which the bag does not define"),
        ("float64 x\nfloat64[ y\n", "the definition of its type lab/msg/Root is not readable"),
        ("wstring x\n", "hold the type lab/msg/wstring, which the bag does not define"),
    ],
)
def test_definitions_that_cannot_be_used(text, what):
    with pytest.raises(InputError, match=rf"bag: topic /t.*{what}"):
        message_type(Topic("/t", "lab/msg/Root", "cdr", "ros2msg", text), "bag")


def test_structures_without_end():
    """A type that takes no bytes, a billion times."""
    text = f"Nothing[1000000000] much\n{SEPARATOR}MSG: lab/Nothing\n"
    kind = message_type(Topic("/t", "lab/msg/Root", "cdr", "ros2msg", text), "bag")
    with pytest.raises(InputError, match="it holds more than 10000 strings and structures"):
        CdrReader(kind, [], stamp=False).read(messages(b"\0\1\0\0" + b"\0" * 100))


def test_definitions_in_idl():
    idl = (
        f"{SEPARATOR}IDL: lab/msg/Root\nmodule lab {{ module msg {{ struct Root {{ double x; sequence<float> y; "
        "}; }; };\n"
    )
    kind = message_type(Topic("/t", "lab/msg/Root", "cdr", "ros2idl", idl), "bag")
    payload = b"\0\1\0\0" + struct.pack("<dI2f", 0.1, 2, 0.5, 0.25)
    reader = CdrReader(kind, [Selector("x"), Selector("y[1]"), Selector("y[2]")], stamp=False)
    np.testing.assert_array_equal(reader.read(messages(payload))[1], [[0.1, 0.25, np.nan]])


@pytest.mark.parametrize(
    ("path", "what"),
    [
        ("poimt.x", r"has no field 'poimt'; the fields of geometry_msgs/msg/PointStamped are header, point"),
        ("point.w", r"point has no field 'w'; the fields of geometry_msgs/msg/Point are x, y, z"),
        ("point", r"field 'point' is a geometry_msgs/msg/Point, not a number"),
        ("point.x.y", r"field 'point.x' is a number and has no fields"),
        ("point.x[0]", r"field 'point.x\[0\]' is not an array"),
        ("header.frame_id", r"field 'header.frame_id' is a string, not a number"),
        ("point..x", r"point has no field ''"),
    ],
)
def test_paths_that_lead_nowhere(path, what):
    with pytest.raises(InputError, match=rf"bag: topic /t: {what}"):
        message_type(Topic("/t", bags.POINT, "cdr"), "bag").require(path)
    with pytest.raises(
        InputError, match=r"field 'position' is an array; name one element, such as position\[0\]"
    ):
        KIND.require("position")


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
