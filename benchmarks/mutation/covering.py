"""Which tests cover a line, and what they say of a change, in a copy of the tree."""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
from collections import defaultdict
from itertools import accumulate
from math import log2
from pathlib import Path

import coverage
import pytest

from mutation.mutants import Mutant

TOP = Path(__file__).resolve().parents[2]
PACKAGES = ("estimator", "mocobot_inspect")
TESTS = ("-m", "not slow", "tests/estimator", "tests/inspect", "tests/command/test_folders.py")
TREE = ("src", "tests", "benchmarks", "models", "scenarios", "docs", "pyproject.toml", "README.md")
MEMORY_B = 8 << 30
FORK = multiprocessing.get_context("fork")
for name in (
    "numpy", "scipy.optimize", "scipy.signal", "scipy.ndimage", "scipy.spatial.transform", "pyarrow.parquet", "mujoco",
    "dm_control.mjcf", "pinocchio", "joblib", "tyro", "rosbags.rosbag2", "mcap.reader", "ruamel.yaml",
):  # fmt: skip
    importlib.import_module(name)  # once, and not in every process
PLUGIN = """import json, os, pathlib, pytest
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    rank = {name: k for k, name in enumerate(json.loads(pathlib.Path(os.environ["MUTATION_TESTS"]).read_text()))}
    items[:] = sorted((i for i in items if i.nodeid in rank), key=lambda i: rank[i.nodeid])
"""


class Tests:
    """Which tests cover a line, and how long each takes."""

    def __init__(self, work: Path, most_s: float, fresh: bool) -> None:
        self.work, self.copy, self.most_s, log = work, work / "tree", most_s, work / "tests.log"
        shutil.rmtree(self.copy, ignore_errors=True)
        self.copy.mkdir(parents=True)
        for name in TREE:
            (shutil.copytree if (TOP / name).is_dir() else shutil.copy)(TOP / name, self.copy / name)
        (self.copy / "fastest_first.py").write_text(PLUGIN)
        if fresh or not log.exists():
            where = [f"--cov=src/{name}" for name in PACKAGES]
            words = ["-q", "-vv", "--durations=0", *where, "--cov-context=test", "--cov-report=", *TESTS]
            code, printed = self.pytest(words, 7200.0)
            log.write_text(printed)
            if code:
                sys.exit(f"tests fail without any change, see {log}")
            shutil.copy(self.copy / ".coverage", work / "coverage.db")
        self.data = coverage.CoverageData(str(work / "coverage.db"))
        self.data.read()
        self.seconds: dict[str, float] = defaultdict(float)
        self.of_file: dict[str, set[str]] = defaultdict(set)
        durations = re.compile(r"^([\d.]+)s (?:call|setup|teardown) +(\S.*)$", re.MULTILINE)
        for seconds, name in durations.findall(log.read_text()):
            self.seconds[name] += float(seconds)
            self.of_file[name.split("::")[0]].add(name)
        self.sources = {path: path.read_text().splitlines() for path in (self.copy / "src").rglob("*.py")}

    def pytest(self, words: list[str], timeout_s: float) -> tuple[int | None, str]:
        """Exit code, None where time ran out, and what was printed; in a process of its own."""
        child = FORK.Process(target=self._child, args=(words,))
        child.start()
        child.join(timeout_s)
        if late := child.is_alive():
            os.killpg(child.pid or 0, signal.SIGKILL)
            child.join()
        return None if late else child.exitcode, (self.work / "printed.txt").read_text(errors="replace")

    def _child(self, words: list[str]) -> None:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_B, MEMORY_B))
        os.chdir(self.copy)
        printed = os.open(self.work / "printed.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(printed, stream)
        paths = [str(self.copy / "src"), str(self.copy)]
        sys.path[:0] = paths
        os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "MUTATION_TESTS": str(self.work / "chosen.json")}
        code = pytest.main(["-p", "no:cacheprovider", *words])
        sys.stdout.flush()
        os._exit(code)

    def on(self, path: Path, lines: range | None = None) -> set[str]:
        """Tests that run lines in functions of a file; all of a test's file where a fixture or a cache does it."""
        found: set[str] = set()
        by_line = self.data.contexts_by_lineno(str(path))
        for context in {c for line in by_line if lines is None or line in lines for c in by_line[line]}:
            name, _, phase = context.partition("|")
            if name:
                file = name.split("::")[0]
                shared = phase != "run" or "cache" in (self.copy / file).read_text()
                found |= self.of_file[file] if shared else {name}
        return found

    def covering(self, mutant: Mutant) -> list[str]:
        """The fastest first, as many as there is time for."""
        path = self.copy / mutant.path
        found = set() if mutant.names else self.on(path, mutant.statement)
        wanted, seen = set(mutant.names) - {""}, set()
        while wanted - seen:
            name = min(wanted - seen)
            seen.add(name)
            for file, text in self.sources.items():
                for k, line in enumerate(text, start=1):
                    if re.search(rf"\b{name}\b", line):
                        found |= self.on(file, range(k, k + 1))
                        wanted |= set(re.findall(r"^(\w+)\b.*= ", line))  # a constant that depends on it
        if mutant.names:
            found = found or self.on(path)
        # A file's tests share fixtures, so those that take about as long stay together.
        order = sorted(found, key=lambda test: (round(log2(self.seconds[test] + 0.05) / 2), test))
        until = accumulate(self.seconds[name] for name in order)
        return [
            name for k, (name, s) in enumerate(zip(order, until, strict=True)) if s <= self.most_s or not k
        ]

    def verdict(self, mutant: Mutant) -> tuple[str, str, str]:
        """Killed, survived, timed out or not covered; the last words of the tests; the change."""
        file, names = self.copy / mutant.path, self.covering(mutant)
        source = file.read_text()
        changed = mutant.apply(source)
        both = (text.splitlines(keepends=True) for text in (source, changed))
        diff = "".join(difflib.unified_diff(*both, mutant.path, "", n=1))
        if not names:
            return "not covered", "", diff
        Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)
        file.write_text(changed)
        try:
            code, printed = self.run(names)
        finally:
            file.write_text(source)
            Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)
        verdict = "timed out" if code is None else "survived" if code in (0, 5) else "killed"
        failed = re.findall("^(?:FAILED|ERROR) (.*)", printed, re.MULTILINE)
        return verdict, (failed or printed.strip().splitlines() or [""])[-1], diff

    def run(self, names: list[str]) -> tuple[int | None, str]:
        """Some of the tests, in that order, to the first that fails."""
        (self.work / "chosen.json").write_text(json.dumps(names))
        files = list(dict.fromkeys(name.split("::")[0] for name in names))
        timeout_s = 120.0 + 5.0 * sum(self.seconds[name] for name in names)
        return self.pytest(["-x", "-q", "-p", "fastest_first", *files], timeout_s)
