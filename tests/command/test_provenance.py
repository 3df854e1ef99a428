"""Provenance: hashes against coreutils, commits against git, and the files that commands put it into."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from estimator.errors import InputError
from mocobot.cli import main
from mocobot.files import provenance as module
from mocobot.files.provenance import file_facts, folder_provenance, provenance
from mocobot_view.payload import read_estimate

KEYS = ["mocobot", "commit", "python", "platform", "packages", "command", "options", "files"]
GIT = ["git", "-c", "user.name=test", "-c", "user.email=test@test.invalid", "-c", "init.defaultBranch=main"]


def git(folder: Path, *arguments: str) -> str:
    return subprocess.run(
        [*GIT, "-C", str(folder), *arguments], capture_output=True, text=True, check=True
    ).stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A repository laid out like ours, with one commit."""
    root = tmp_path / "checkout"
    (root / "src" / "mocobot" / "files").mkdir(parents=True)
    (root / "docs").mkdir()
    (root / "src" / "mocobot" / "files" / "provenance.py").write_text("")
    (root / "docs" / "page.md").write_text("")
    git(tmp_path, "init", "--quiet", "checkout")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "-m", "first")
    return root.resolve()


def test_hash_and_size_are_those_of_coreutils(tmp_path: Path) -> None:
    path = tmp_path / "large.bin"
    path.write_bytes(b"mocobot" * 700_001)
    said = subprocess.run(
        ["sha256sum", str(path)], capture_output=True, text=True, check=True
    ).stdout.split()[0]
    assert file_facts(path) == {"name": "large.bin", "path": str(path), "bytes": 4_900_007, "sha256": said}


def test_a_large_file_is_not_held_in_memory(tmp_path: Path) -> None:
    """200 MB (of zeros, sparse) hashed in a process that may have 100 MB more than it has when it starts."""
    path = tmp_path / "huge.bin"
    with path.open("wb") as file:
        file.truncate(200_000_000)
    code = (
        "import resource, sys; from pathlib import Path; from mocobot.files.provenance import file_facts\n"
        "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 100_000_000,) * 2)\n"
        "print(file_facts(Path(sys.argv[1]))['sha256'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == hashlib.sha256(bytes(200_000_000)).hexdigest()


def test_keys_and_plain_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rec.parquet").write_bytes(b"")
    options = {
        "rec": (Path("rec.parquet"),), "out": Path("est.json"), "jobs": 2, "seed": 7, "preset": ("ideal", "nominal"),
        "tolerances": Path("mine/tol.toml"), "cutoff_hz": 5.0, "nothing": None,
    }  # fmt: skip
    said = provenance("estimate", options, [Path("rec.parquet")])
    assert list(said) == KEYS
    assert said["options"] == {
        "seed": 7, "preset": ["ideal", "nominal"], "tolerances": "mine/tol.toml", "cutoff_hz": 5.0, "nothing": None,
    }  # fmt: skip
    assert said["packages"]["numpy"] == version("numpy")
    assert said["packages"]["mujoco"] == version("mujoco")
    assert said["mocobot"] == version("mocobot")
    assert said["python"] == sys.version.split()[0]
    assert said["files"][0]["path"] == "rec.parquet"
    assert json.loads(json.dumps(said)) == said
    assert str(tmp_path) not in json.dumps(said)
    assert provenance("estimate", options | {"out": Path("b.json"), "jobs": 1}, [Path("rec.parquet")]) == said


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be read.*No such file"):
        provenance("estimate", {}, [tmp_path / "none.parquet"])


def test_a_folder_is_all_its_files(tmp_path: Path) -> None:
    """Such as a bag."""
    (tmp_path / "bag" / "deep").mkdir(parents=True)
    paths = [tmp_path / "bag" / "a.mcap", tmp_path / "bag" / "deep" / "b.yaml"]
    for path in paths:
        path.write_text(path.name)
    said = provenance("estimate", {}, [tmp_path / "bag"])
    assert said["files"] == [file_facts(path) for path in paths]


def test_commit_is_gits_and_changes_of_sources_show(checkout: Path) -> None:
    head = git(checkout, "rev-parse", "HEAD")
    assert module._commit(checkout) == head
    (checkout / "docs" / "page.md").write_text("changed")
    assert module._commit(checkout) == head, "documents change no result"
    (checkout / "src" / "mocobot" / "new.py").write_text("")
    assert module._commit(checkout) == f"{head}+changed"


def test_commit_of_others_is_not_ours(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head = git(checkout, "rev-parse", "HEAD")
    inside = checkout / "lib" / "site"  # a package that was installed below somebody's repository
    (inside / "src" / "mocobot" / "files").mkdir(parents=True)
    shutil.copy(
        checkout / "src" / "mocobot" / "files" / "provenance.py", inside / "src" / "mocobot" / "files"
    )
    assert module._commit(inside) is None
    shutil.rmtree(checkout / "lib")
    monkeypatch.setenv("GIT_DIR", str(checkout / "nowhere"))  # as a hook of another repository sets it
    assert module._commit(checkout) == head
    monkeypatch.setenv("PATH", str(checkout / "nowhere"))
    assert module._commit(checkout) is None
    monkeypatch.undo()
    shutil.rmtree(checkout / ".git")
    assert module._commit(checkout) is None


def test_folder_lists_what_was_written(tmp_path: Path) -> None:
    (tmp_path / "estimates").mkdir()
    paths = [tmp_path / "paper.json", tmp_path / "estimates" / "z.json"]
    for path in paths:
        path.write_text(path.name)
    said = folder_provenance(provenance("paper", {"seed": 3}), tmp_path, paths)
    assert (said["format"], said["version"]) == ("mocobot-provenance", 1)
    assert [entry["path"] for entry in said["written"]] == ["estimates/z.json", "paper.json"]
    assert said["written"][1]["sha256"] == hashlib.sha256(b"paper.json").hexdigest()


def test_estimate_carries_it_and_is_the_same_bytes_again(
    biased_trials: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = [tmp_path / "one.json", tmp_path / "two.json"]
    for path in out:
        main(["estimate", str(biased_trials[0]), "--out", str(path), "--cutoff-hz", "4"])
    capsys.readouterr()
    assert out[0].read_bytes() == out[1].read_bytes()
    values = json.loads(out[0].read_text())
    assert list(values["provenance"]) == KEYS
    assert values["provenance"]["command"] == "estimate"
    assert values["provenance"]["options"] == {
        "map": None, "method": "auto", "cutoff_hz": 4.0, "calibration": None, "self_calibrate": False,
        "max_unpacked": None,
    }  # fmt: skip
    assert [entry["path"] for entry in values["provenance"]["files"]] == [str(biased_trials[0])]
    read_estimate(out[0])  # as replay reads it
