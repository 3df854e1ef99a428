"""Files of numbers: what is taken, what is refused, and the sentence that says why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.errors import InputError
from estimator.strict import Fields, check_known, parse_json, read_json, read_toml

VALUES = {
    "whole": 2, "number": 0.5, "flag": True, "text": "a word", "list": [1, 2.5], "object": {"a": 1}, "matrix": [[1, 2]],
}  # fmt: skip


def fields(**values: Any) -> Fields:
    return Fields(VALUES | values, list(VALUES), "file.json")


def refused(read: Callable[[], object]) -> str:
    with pytest.raises(InputError) as error:
        read()
    return str(error.value)


def test_what_is_there_is_read() -> None:
    found = fields()
    assert (found.whole("whole"), found.number("number"), found.flag("flag")) == (2, 0.5, True)
    assert found.number("whole", 2.0) == 2.0
    assert isinstance(found.number("whole"), float)
    assert (found.text("text"), found.words("text")) == ("a word", "a word")
    assert found.one_of("text", ["b", "a word"]) == "a word"
    assert found.list("list") == found.list("list", 2) == [1, 2.5]
    assert found.within("object", ["a"]).whole("a") == 1
    np.testing.assert_array_equal(found.array("matrix", (1, 2)), [[1.0, 2.0]])
    assert "text" in found
    assert "other" not in found


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (lambda: fields(number=float("inf")).number("number"), "number is inf; it must be a finite number"),
        (lambda: fields(number=True).number("number"), "number is True; it must be a finite number"),
        (lambda: fields(number=1.1e300).number("number"), "number is 1.1e+300; it must be a finite number"),
        (lambda: fields().number("number", 0.6), "number is 0.5; it must be a number of at least 0.6"),
        (lambda: fields().number("number", above=0.5), "number is 0.5; it must be greater than 0.5"),
        (lambda: fields(whole=0).whole("whole"), "whole is 0; it must be a whole number of at least 1"),
        (lambda: fields(whole=-1).whole("whole", 0), "whole is -1; it must be a whole number of at least 0"),
        (lambda: fields(whole=True).whole("whole"), "whole is True; it must be a whole number of at least 1"),
        (lambda: fields(whole=1.0).whole("whole"), "whole is 1.0; it must be a whole number of at least 1"),
        (lambda: fields(flag=1).flag("flag"), "flag is 1; it must be true or false"),
        (lambda: fields(text="").text("text"), "text is ''; it must be printable text"),
        (lambda: fields(text="a\x1b").text("text"), "text is 'a\\x1b'; it must be printable text"),
        (lambda: fields(text=1).text("text"), "text is 1; it must be printable text"),
        (lambda: fields(text=1).words("text"), "text is 1; it must be a text"),
        (lambda: fields().one_of("text", "ab"), "text is 'a word'; it must be one of 'a', 'b'"),
        (lambda: fields(text=["a"]).one_of("text", "ab"), "text is ['a']; it must be one of 'a', 'b'"),
        (lambda: fields(object=[]).object("object"), "object is []; it must be an object"),
        (lambda: fields(list={}).list("list"), "list is {}; it must be a list"),
        (lambda: fields().list("list", 3), "list is [1, 2.5]; it must be a list of 3 entries"),
        (lambda: fields().array("matrix", (2, 2)), "matrix is [[1, 2]]; it must be 2 x 2 finite numbers"),
        (lambda: fields().array("matrix", (1, 3)), "matrix is [[1, 2]]; it must be 1 x 3 finite numbers"),
        (lambda: fields(matrix=[1, None]).array("matrix", (2,)), "matrix is [1, None]; it must be 2 finite numbers"),
        (lambda: fields(matrix=1).array("matrix", (1,)), "matrix is 1; it must be 1 finite numbers"),
    ],
)  # fmt: skip
def test_what_is_of_another_kind_is_refused(read: Callable[[], object], said: str) -> None:
    assert refused(read) == f"file.json: {said}"


def test_keys() -> None:
    assert refused(lambda: Fields({}, ["a", "b"], "f")) == "f: missing key 'a'; the keys are a, b"
    assert (
        refused(lambda: Fields({"a": 1}, ["a", "b"], "f", ["c"])) == "f: missing key 'b'; required are a, b"
    )
    assert Fields({"a": 1}, ["a"], "f", ["c"]).whole("a") == 1
    nearest = refused(lambda: Fields({"gravty": 1}, ["gravity", "mass"], "f"))
    assert nearest == "f: unknown key 'gravty' (did you mean 'gravity'?); the keys are gravity, mass"
    assert refused(lambda: check_known(["zz"], ["gravity"], "f", "name")) == (
        "f: unknown name 'zz'; the names are gravity"
    )
    assert refused(lambda: fields().within("object", ["b"])).startswith("file.json: object: unknown key 'a'")
    assert refused(lambda: Fields([1], ["a"], "f")) == "f is [1]; it must be an object"  # type: ignore[arg-type]


def test_json() -> None:
    assert parse_json('{"a": [1, 2]}', "f") == {"a": [1, 2]}
    assert (
        refused(lambda: parse_json('{"a": 1, "b": 1, "b": 2}', "f"))
        == "f: not valid JSON (key 'b' appears twice)"
    )
    assert refused(lambda: parse_json('{"a": NaN}', "f")) == "f: not valid JSON (NaN is not a JSON number)"
    assert refused(lambda: parse_json("[1]", "f")) == "f: must be a JSON object, not [1]"
    assert refused(lambda: parse_json("[" * 100_000, "f")).startswith("f: not valid JSON (")


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "f"
    assert refused(lambda: read_json(path, "a set")) == f"{path}: there is no such file; it would be a set"
    assert refused(lambda: read_json(tmp_path, "a set")).startswith(f"{tmp_path}: ")
    path.write_bytes(b"PAR1xx")
    assert refused(lambda: read_json(path, "a set")) == (
        f"{path}: a Parquet file, as recordings are; it must be a set"
    )
    path.write_text('{"a": 1}')
    assert read_json(path, "a set") == {"a": 1}
    assert refused(lambda: read_toml(path, "map")).startswith(f"{path}: not a readable map (")
    assert refused(lambda: read_toml(tmp_path / "g", "map")).endswith("(No such file or directory)")
    path.write_text("a = 1")
    assert read_toml(path, "map") == {"a": 1}
