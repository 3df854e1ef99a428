"""The numbers that decide stand in one place."""

from __future__ import annotations

import ast
from dataclasses import fields
from pathlib import Path

import discrepancy.evidence
from discrepancy.evidence.settings import SETTINGS, Settings

FOLDER = Path(discrepancy.evidence.__file__).parent


def constants(path: Path) -> list[str]:
    """Upper-case names with numbers in their values."""
    return [
        ast.unparse(node)
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        and all(isinstance(t, ast.Name) and t.id.isupper() for t in node.targets)
        and any(
            isinstance(n, ast.Constant) and isinstance(n.value, int | float) for n in ast.walk(node.value)
        )
    ]


def test_the_engine_has_no_other_constants() -> None:
    files = [path for path in FOLDER.glob("*.py") if path.name != "settings.py"]
    assert len(files) > 3
    assert {path.name: constants(path) for path in files if constants(path)} == {}


def test_every_setting_is_explained_and_used() -> None:
    names = [field.name for field in fields(Settings)]
    assert len(names) <= 40
    code = "".join(
        p.read_text(encoding="utf-8") for p in FOLDER.parent.rglob("*.py") if p.name != "settings.py"
    )
    for name in names:
        assert f"        {name}: " in (Settings.__doc__ or "")
        assert f".{name}" in code
        assert getattr(SETTINGS, name) > 0
