"""Which tests cover a line, and what they say of a change, in a copy of the tree."""

from __future__ import annotations

import difflib
import importlib.util
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import coverage

from mutation.mutants import Mutant

TOP = Path(__file__).resolve().parents[2]
PACKAGES = ("estimator", "mocobot_inspect")
TESTS = ("tests/estimator", "tests/inspect")
TREE = ("src", "tests", "benchmarks", "models", "scenarios", "docs", "pyproject.toml", "README.md")
MEMORY_B = 8 << 30
PLUGIN = """import json, os, pytest
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    rank = {name: k for k, name in enumerate(json.load(open(os.environ["MUTATION_TESTS"])))}
    items[:] = sorted((i for i in items if i.nodeid in rank), key=lambda i: rank[i.nodeid])
"""


class Tests:
    """Which tests cover a line, and how long each takes."""

    def __init__(self, work: Path, fresh: bool) -> None:
        self.work, self.copy, log = work, work / "tree", work / "tests.log"
        shutil.rmtree(self.copy, ignore_errors=True)
        self.copy.mkdir(parents=True)
        for name in TREE:
            (shutil.copytree if (TOP / name).is_dir() else shutil.copy)(TOP / name, self.copy / name)
        (self.copy / "fastest_first.py").write_text(PLUGIN)
        if fresh or not log.exists():
            words = [
                "-q",
                "-vv",
                "--durations=0",
                *(f"--cov=src/{name}" for name in PACKAGES),
                "--cov-context=test",
            ]
            done = self.pytest([*words, "--cov-report=", *TESTS], 3600.0)
            log.write_text(done.stdout)
            if done.returncode:
                sys.exit(f"tests fail without any change, see {log}")
            shutil.copy(self.copy / ".coverage", work / "coverage.db")
        self.data = coverage.CoverageData(str(work / "coverage.db"))
        self.data.read()
        self.seconds: dict[str, float] = defaultdict(float)
        self.of_file: dict[str, set[str]] = defaultdict(set)
        for seconds, name in re.findall(
            r"^([\d.]+)s (?:call|setup|teardown) +(\S.*)$", log.read_text(), re.M
        ):
            self.seconds[name] += float(seconds)
            self.of_file[name.split("::")[0]].add(name)
        self.sources = {path: path.read_text().splitlines() for path in (self.copy / "src").rglob("*.py")}

    def pytest(self, words: list[str], timeout_s: float) -> subprocess.CompletedProcess[str]:
        paths = os.pathsep.join([str(self.copy / "src"), str(self.copy)])
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words], cwd=self.copy, timeout=timeout_s,
            env=os.environ | {"PYTHONPATH": paths, "MUTATION_TESTS": str(self.work / "chosen.json")}, text=True,
            capture_output=True, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY_B, MEMORY_B)),
        )  # fmt: skip

    def on(self, path: Path, lines: range | None = None) -> set[str]:
        """Tests that run lines in functions of a file; all of a test's file where a fixture or a cache does it."""
        found: set[str] = set()
        by_line = self.data.contexts_by_lineno(str(path))
        for context in {
            c for line, all_of in by_line.items() if lines is None or line in lines for c in all_of
        }:
            name, _, phase = context.partition("|")
            if name:
                file = name.split("::")[0]
                shared = phase != "run" or "cache" in (self.copy / file).read_text()
                found |= self.of_file[file] if shared else {name}
        return found

    def covering(self, mutant: Mutant) -> list[str]:
        """The fastest first, a file's together."""
        path = self.copy / mutant.path
        found = set() if mutant.names else self.on(path, mutant.lines())
        wanted, seen = set(mutant.names) - {""}, set()
        while wanted - seen:
            name = min(wanted - seen)
            seen.add(name)
            for file, text in self.sources.items():
                for k, line in enumerate(text, start=1):
                    if re.search(rf"\b{name}\b", line):
                        found |= self.on(file, range(k, k + 1))
                        wanted |= set(re.findall(r"^(\w+)\b.*= ", line))  # a constant that depends on it
        found = found or self.on(path)
        of_file: dict[str, float] = defaultdict(float)
        for name in found:
            of_file[name.split("::")[0]] += self.seconds[name]
        return sorted(
            found, key=lambda name: (of_file[name.split("::")[0]], name.split("::")[0], self.seconds[name])
        )

    def verdict(self, mutant: Mutant) -> tuple[str, str, str]:
        """Killed, survived, timed out or not covered; the last words of the tests; the change."""
        file, names = self.copy / mutant.path, self.covering(mutant)
        source = file.read_text()
        changed = mutant.apply(source)
        diff = "".join(
            difflib.unified_diff(*(t.splitlines(True) for t in (source, changed)), mutant.path, "", n=1)
        )
        if not names:
            return "not covered", "", diff
        (self.work / "chosen.json").write_text(json.dumps(names))
        Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)
        file.write_text(changed)
        try:
            needed = 120.0 + 5.0 * sum(self.seconds[name] for name in names)
            files = list(dict.fromkeys(name.split("::")[0] for name in names))
            done = self.pytest(["-x", "-q", "-p", "fastest_first", *files], needed)
        except subprocess.TimeoutExpired:
            return "timed out", "", diff
        finally:
            file.write_text(source)
            Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)
        return (
            "survived" if done.returncode in (0, 5) else "killed",
            done.stdout.strip().splitlines()[-1],
            diff,
        )
