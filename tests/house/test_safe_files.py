"""Nothing in the source executes what a file says."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from source_tree import SRC, imported_modules

FORBIDDEN_MODULES = {
    "cloudpickle",
    "dill",
    "jsonpickle",
    "marshal",
    "pickle",
    "shelve",
    "yaml",
    "joblib.load",
    "joblib.dump",
}
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__"}


def unsafe(path: Path) -> list[str]:
    """What a file has that may execute what it reads."""
    found = [f"import {name}" for name in sorted(imported_modules(path))
             if name in FORBIDDEN_MODULES or name.split(".")[0] in FORBIDDEN_MODULES]  # fmt: skip
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        given = {word.arg: ast.unparse(word.value) for word in node.keywords}
        if called in FORBIDDEN_CALLS or called in ("joblib.load", "pd.read_pickle", "torch.load"):
            found.append(called)
        if given.get("allow_pickle", "False") != "False":
            found.append(f"{called} with allow_pickle")
        if called.split(".")[-1] == "YAML" and given.get("typ") != "'safe'":
            found.append(f"{called} that is not safe")
    return found


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import pickle", "import pickle"),
        ("from joblib import Parallel, load", "import joblib.load"),
        ("import joblib\njoblib.load('a')", "joblib.load"),
        ("import marshal", "import marshal"),
        ("from shelve import open", "import shelve"),
        ("import yaml", "import yaml"),
        ("eval('1')", "eval"),
        ("exec('1')", "exec"),
        ("np.load('a', allow_pickle=True)", "np.load with allow_pickle"),
        ("np.load('a', allow_pickle=trusted)", "np.load with allow_pickle"),
        ("YAML(typ='unsafe')", "YAML that is not safe"),
        ("YAML()", "YAML that is not safe"),
        ("np.load('a', allow_pickle=False); YAML(typ='safe', pure=True); re.compile('a')", None),
    ],
)
def test_what_is_found(tmp_path: Path, text: str, what: str | None) -> None:
    (tmp_path / "a.py").write_text(text)
    assert (what in unsafe(tmp_path / "a.py")) if what else unsafe(tmp_path / "a.py") == []


def test_no_file_is_executed() -> None:
    wrong = {
        str(path.relative_to(SRC)): found for path in sorted(SRC.rglob("*.py")) if (found := unsafe(path))
    }
    assert wrong == {}
