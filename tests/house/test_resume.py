"""A run goes on with outcomes of the same code, models and options alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from mocobot import results as resume
from source_tree import SRC, imported_modules, module_files

FILES = {
    "discrepancy": "src/discrepancy/team/rig.py",
    "estimator": "src/estimator/so3.py",
    "mocobot": "src/mocobot/api/simulation.py",
    "mocobot_logs": "src/mocobot_logs/resample_filter.py",
    "mocobot_sim": "src/mocobot_sim/trial/trial.py",
    "a model": "models/omnid/omnid.xml",
    "a model's design": "models/omnid/design.toml",
}


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An installation of a few files, which digests are then of."""
    for name in ("src/mocobot/results.py", "src/mocobot_view/scene.py", *FILES.values()):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("as it was")
    monkeypatch.setattr(resume, "__file__", str(tmp_path / "src/mocobot/results.py"))
    monkeypatch.setattr(resume, "models_dir", lambda: tmp_path / "models")
    resume.code_digest.cache_clear()
    yield tmp_path
    resume.code_digest.cache_clear()


def key(**options: object) -> str:
    resume.code_digest.cache_clear()
    return resume.run_key(options)


@pytest.mark.parametrize("name", list(FILES))
def test_other_code_or_models_make_another_key(tree: Path, name: str) -> None:
    before = key()
    assert key() == before
    (tree / FILES[name]).write_text("otherwise")
    assert key() != before


def test_what_only_shows_results_does_not_matter(tree: Path) -> None:
    before = key()
    (tree / "src/mocobot_view/scene.py").write_text("otherwise")
    assert key() == before


def test_other_options_make_another_key(tree: Path) -> None:
    assert len({key(), key(seed=1), key(seed=2), key(trials=1)}) == 4
    assert key(seed=1, trials=2) == key(trials=2, seed=1)


def test_whatever_estimates_and_simulates_is_looked_at() -> None:
    """All packages that those whose outcomes are kept import."""
    needed = {"estimator", "discrepancy", "mocobot_sim"}
    for package in ("estimator", "discrepancy", "mocobot_sim"):
        for path in module_files(package).values():
            needed |= {module.split(".")[0] for module in imported_modules(path)}
    ours = {path.name for path in SRC.iterdir() if (path / "__init__.py").is_file()}
    assert needed & ours <= set(resume.CODE)
