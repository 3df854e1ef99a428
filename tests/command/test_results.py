"""Results: whole folders or none, nothing of the user's lost, and provenance against coreutils and git."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from functools import partial
from importlib.metadata import version
from pathlib import Path

import pytest

from estimator.errors import InputError
from estimator.files import LIST, check_target, holds, make_folder, whole_file, whole_folder, write_text
from mocobot.checks import check_folder
from mocobot.cli import main
from mocobot.results import commit_of, file_facts, folder_provenance, provenance
from mocobot_view.payload import read_estimate


def test_a_folder_appears_when_all_is_written(tmp_path):
    out = tmp_path / "out"
    with whole_folder(out, "x") as folder:
        (folder / "a").write_text("1")
        assert not out.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (out / "a").read_text() == "1"


def test_an_earlier_one_is_replaced_or_kept(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("old")

    def half() -> None:
        with whole_folder(out, "x") as folder:
            (folder / "new").write_text("new")
            raise ValueError("stop")

    with pytest.raises(ValueError, match="stop"):
        half()
    assert [path.name for path in out.iterdir()] == ["old"]
    with whole_folder(out, "x") as folder:
        (folder / "new").write_text("new")
    assert sorted(path.name for path in out.iterdir()) == [LIST, "new", "old"], "nobody listed the old one"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    with whole_folder(out, "x") as folder:
        (folder / "newer").write_text("newer")
    assert sorted(path.name for path in out.iterdir()) == [LIST, "newer", "old"]


def test_a_link_to_a_folder_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with whole_folder(tmp_path / "link", "x") as folder:
        (folder / "a").write_text("1")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "a").exists()


def test_what_cannot_be_put_in_place_is_one_sentence(tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("old")
    rename = Path.rename

    def full(self: Path, target: Path) -> Path:
        if self.name.endswith(".tmp"):
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(InputError, match=r"out: cannot be written .No space left"), whole_folder(out, "x"):
        pass
    assert [path.name for path in out.iterdir()] == ["old"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_inputs_inside_the_folder_are_not_lost(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "rec").write_text("1")
    with pytest.raises(InputError, match="rec, which would be lost"):
        check_folder(out, [out / "rec"], lambda _: True, "a result", force=True)
    check_folder(out, [], lambda _: True, "a result", force=True)
    with pytest.raises(InputError, match="out: is a result; give --force"):
        check_folder(out, [], lambda _: True, "a result", force=False)
    with pytest.raises(InputError, match="out: exists and is not a result"):
        check_folder(out, [], lambda _: False, "a result", force=True)
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(tmp_path / ("x" * 300), [], lambda _: True, "a result", force=True)


def test_missing_folders_are_made_and_do_not_outlive_a_failure(tmp_path):
    """For files as for folders; what was there before stays."""
    (tmp_path / "there").mkdir()
    for whole in (whole_file, partial(whole_folder, kind="x")):
        target = tmp_path / "there" / "a" / "b" / "out"

        def half(whole=whole, target=target) -> None:
            with whole(target):
                raise ValueError("stop")

        with pytest.raises(ValueError, match="stop"):
            half()
        assert [path.name for path in tmp_path.rglob("*")] == ["there"]
        with whole(target) as temporary:
            (temporary / "in" if temporary.is_dir() else temporary).write_text("1")
        assert [path.name for path in target.parent.iterdir()] == ["out"]
        [path.unlink() for path in ([*target.iterdir()] if target.is_dir() else [target])]
        shutil.rmtree(tmp_path / "there" / "a")


def test_places_are_tried_before_the_work(tmp_path, monkeypatch):
    """The superuser may write against all permission bits, so the system's own refusal is what counts."""
    (tmp_path / "file").write_text("1")
    for target in (tmp_path / "file" / "out", tmp_path / "file" / "a" / "b" / "out"):
        with pytest.raises(InputError, match=r"out: cannot be written \(.*/file is a file\)"):
            check_target(target)
    with pytest.raises(InputError, match=r"/proc/self/a/out: cannot be written \("):
        check_target(Path("/proc/self/a/out"))
    with pytest.raises(InputError, match="not a regular file"):
        check_target(Path("/dev/null"))
    check_target(tmp_path / "a" / "b" / "out")
    (tmp_path / "b").mkdir()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "file"]

    def read_only(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system", "/a/name/of/no/interest")

    monkeypatch.setattr("tempfile.TemporaryFile", read_only)
    with pytest.raises(InputError, match=r"out: cannot be written \(Read-only file system\)$"):
        check_target(tmp_path / "out")
    with pytest.raises(InputError, match="Read-only"):
        make_folder(tmp_path / "b")


def test_a_folder_that_cannot_be_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file: cannot be made a folder"):
        make_folder(tmp_path / "file")
    assert make_folder(tmp_path / "a" / "b").is_dir()


def test_a_file_that_cannot_be_written_is_named_by_its_place(tmp_path):
    """Nobody knows the name of the folder that stands in for it until all is there."""

    def write() -> None:
        with whole_folder(tmp_path / "out", "x") as folder:
            (folder / "a.txt").mkdir()
            write_text(folder / "a.txt", "words")

    with pytest.raises(InputError, match=re.escape(f"{tmp_path / 'out'}/a.txt: cannot be written")):
        write()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_one_sentence_whoever_writes(tmp_path):
    """Libraries that draw pictures raise errors of the system."""

    def write() -> None:
        with whole_folder(tmp_path / "out", "x"), open("/dev/full", "w") as full:
            full.write("words")

    with pytest.raises(InputError, match=r"out: cannot be written \(No space left on device\)"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_what_somebody_put_into_the_folder_is_kept(tmp_path):
    """Before the run it stops it; during the run it moves into the new folder, under another name if it has to."""
    out = tmp_path / "out"
    with whole_folder(out, "x") as folder:
        (folder / "deep").mkdir()
        for name in ("same", "edited", "deep/gone"):
            (folder / name).write_text("ours")
    with whole_folder(out, "x") as folder:
        (folder / "same").write_text("new")
        (folder / "edited").write_text("new")
        (out / "edited").write_text("mine")
        (out / "deep" / "notes.txt").write_text("mine")
        (out / "empty").mkdir()
        (out / "link").symlink_to(tmp_path)
    found = {str(path.relative_to(out)): path for path in out.rglob("*")}
    assert found.keys() == {LIST, "same", "edited", "edited.kept", "deep", "deep/notes.txt", "empty", "link"}
    assert [found[name].read_text() for name in ("same", "edited", "edited.kept")] == ["new", "new", "mine"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    with pytest.raises(InputError, match=r"notes\.txt: was not written by mocobot, or changed since"):
        check_folder(out, [], holds("x"), "an x", force=True)
    with pytest.raises(InputError, match="exists and is not a y"):
        check_folder(out, [], holds("y"), "a y", force=True)


def test_a_file_that_appears_during_the_run_is_kept(tmp_path):
    out = tmp_path / "out.json"
    check_target(out)
    out.write_text("mine")  # while the work is done
    write_text(out, "result")
    assert (out.read_text(), (tmp_path / "out.json.kept").read_text()) == ("result", "mine")
    check_target(out)
    write_text(out, "again")
    assert len(list(tmp_path.iterdir())) == 2


def test_the_next_run_removes_what_a_dead_one_left(tmp_path):
    code = (
        "import os, sys, pathlib; from estimator.files import scratch_name\n"
        "name = scratch_name(pathlib.Path(sys.argv[1])); name.mkdir(); (name / 'a').touch(); print(name)"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path], capture_output=True, text=True, check=True)
    dead = Path(done.stdout.strip())
    alive = dead.with_name(re.sub(r"-\d+-(?=\w+\.tmp$)", f"-{os.getppid()}-", dead.name))
    other = dead.with_name(re.sub(r"^\.mocobot-[^-]*", ".mocobot-elsewhere", dead.name))
    theirs = tmp_path / ".thesis.tmp"
    for path in (alive, other, theirs):
        path.mkdir()
    assert len({dead, alive, other, theirs}) == 4
    write_text(tmp_path / "out", "result")
    assert set(tmp_path.iterdir()) == {alive, other, theirs, tmp_path / "out"}


KEYS = ["mocobot", "commit", "python", "platform", "packages", "command", "options", "files"]
GIT = ["git", "-c", "user.name=test", "-c", "user.email=test@test.invalid", "-c", "init.defaultBranch=main"]


def git(folder: Path, *arguments: str) -> str:
    return subprocess.run(
        [*GIT, "-C", str(folder), *arguments], capture_output=True, text=True, check=True
    ).stdout.strip()


@pytest.fixture
def checkout(tmp_path) -> Path:
    """A repository laid out like ours, with one commit."""
    root = tmp_path / "checkout"
    (root / "src" / "mocobot").mkdir(parents=True)
    (root / "docs").mkdir()
    (root / "src" / "mocobot" / "results.py").write_text("")
    (root / "docs" / "page.md").write_text("")
    git(tmp_path, "init", "--quiet", "checkout")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "-m", "first")
    return root.resolve()


def test_hash_and_size_are_those_of_coreutils(tmp_path):
    path = tmp_path / "large.bin"
    path.write_bytes(b"mocobot" * 700_001)
    said = subprocess.run(
        ["sha256sum", str(path)], capture_output=True, text=True, check=True
    ).stdout.split()[0]
    assert file_facts(path) == {"name": "large.bin", "path": str(path), "bytes": 4_900_007, "sha256": said}


def test_a_large_file_is_not_held_in_memory(tmp_path):
    """200 MB (of zeros, sparse) hashed in a process that may have 100 MB more than it has when it starts."""
    path = tmp_path / "huge.bin"
    with path.open("wb") as file:
        file.truncate(200_000_000)
    code = (
        "import resource, sys; from pathlib import Path; from mocobot.results import file_facts\n"
        "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 100_000_000,) * 2)\n"
        "print(file_facts(Path(sys.argv[1]))['sha256'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == hashlib.sha256(bytes(200_000_000)).hexdigest()


def test_keys_and_plain_values(tmp_path, monkeypatch):
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


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"cannot be read.*No such file"):
        provenance("estimate", {}, [tmp_path / "none.parquet"])


def test_a_folder_is_all_its_files(tmp_path):
    """Such as a bag."""
    (tmp_path / "bag" / "deep").mkdir(parents=True)
    paths = [tmp_path / "bag" / "a.mcap", tmp_path / "bag" / "deep" / "b.yaml"]
    for path in paths:
        path.write_text(path.name)
    said = provenance("estimate", {}, [tmp_path / "bag"])
    assert said["files"] == [file_facts(path) for path in paths]


def test_commit_is_gits_and_changes_of_sources_show(checkout):
    head = git(checkout, "rev-parse", "HEAD")
    assert commit_of(checkout) == head
    (checkout / "docs" / "page.md").write_text("changed")
    assert commit_of(checkout) == head, "documents change no result"
    (checkout / "src" / "mocobot" / "new.py").write_text("")
    assert commit_of(checkout) == f"{head}+changed"


def test_commit_of_others_is_not_ours(checkout, monkeypatch):
    head = git(checkout, "rev-parse", "HEAD")
    inside = checkout / "lib" / "site"  # a package that was installed below somebody's repository
    (inside / "src" / "mocobot").mkdir(parents=True)
    shutil.copy(checkout / "src" / "mocobot" / "results.py", inside / "src" / "mocobot")
    assert commit_of(inside) is None
    shutil.rmtree(checkout / "lib")
    monkeypatch.setenv("GIT_DIR", str(checkout / "nowhere"))  # as a hook of another repository sets it
    assert commit_of(checkout) == head
    monkeypatch.setenv("PATH", str(checkout / "nowhere"))
    assert commit_of(checkout) is None
    monkeypatch.undo()
    shutil.rmtree(checkout / ".git")
    assert commit_of(checkout) is None


def test_folder_lists_what_was_written(tmp_path):
    (tmp_path / "estimates").mkdir()
    paths = [tmp_path / "paper.json", tmp_path / "estimates" / "z.json"]
    for path in paths:
        path.write_text(path.name)
    said = folder_provenance(provenance("paper", {"seed": 3}), tmp_path, paths)
    assert (said["format"], said["version"]) == ("mocobot-provenance", 1)
    assert [entry["path"] for entry in said["written"]] == ["estimates/z.json", "paper.json"]
    assert said["written"][1]["sha256"] == hashlib.sha256(b"paper.json").hexdigest()


def test_estimate_carries_it_and_is_the_same_bytes_again(biased_trials, tmp_path, capsys):
    out = [tmp_path / "one.json", tmp_path / "two.json"]
    for path in out:
        main(["estimate", str(biased_trials[0]), "--out", str(path), "--cutoff-hz", "4"])
    capsys.readouterr()
    assert out[0].read_bytes() == out[1].read_bytes()
    values = json.loads(out[0].read_text())
    assert list(values["provenance"]) == KEYS
    assert values["provenance"]["command"] == "estimate"
    assert values["provenance"]["options"] == {
        "map": None, "episode": None, "method": "auto", "cutoff_hz": 4.0, "calibration": None, "self_calibrate": False,
        "max_unpacked": None, "payload": "auto",
    }  # fmt: skip
    assert [entry["path"] for entry in values["provenance"]["files"]] == [str(biased_trials[0])]
    read_estimate(out[0])  # as replay reads it
