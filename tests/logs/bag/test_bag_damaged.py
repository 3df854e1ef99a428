"""CDR messages of any type against another serialiser, and bags with damaged bytes: sound samples or one sentence."""

import resource
import struct
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import bags
from bags import NO_SUMMARY, UNCHUNKED, Team, raw_mcap, rosbags_bag
from estimator.errors import InputError
from fuzzing import damaged
from mocobot_logs.bag.cdr import CdrReader, Selector, message_type
from mocobot_logs.bag.messages import Topic, joined
from mocobot_logs.bag.read import open_bag
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


KIND = message_type(Topic("/t", bags.JOINT_STATE, "cdr"), "bag")


def joint_reader(*names):
    return CdrReader(KIND, [Selector("position", name) for name in names], stamp=True)


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


def test_definitions_in_idl():
    idl = (
        f"{SEPARATOR}IDL: lab/msg/Root\nmodule lab {{ module msg {{ struct Root {{ double x; sequence<float> y; "
        "}; }; };\n"
    )
    kind = message_type(Topic("/t", "lab/msg/Root", "cdr", "ros2idl", idl), "bag")
    payload = b"\0\1\0\0" + struct.pack("<dI2f", 0.1, 2, 0.5, 0.25)
    reader = CdrReader(kind, [Selector("x"), Selector("y[1]"), Selector("y[2]")], stamp=False)
    np.testing.assert_array_equal(reader.read(messages(payload))[1], [[0.1, 0.25, np.nan]])


RUNS = 60
TEAM = Team.draw(robots=2, rows=40)
MESSAGES = TEAM.said()


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
