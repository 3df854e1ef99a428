"""What README, docs and models' pages point at is there: links, anchors, files, modules, and the packages they list."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest

from source_tree import SRC, module_files

ROOT = SRC.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("models/**/*.md")])
TOP = ("src", "tests", "docs", "models", "scenarios", "benchmarks")
PACKAGES = sorted(path.name for path in SRC.iterdir() if (path / "__init__.py").is_file())

FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
PATH = re.compile(rf"(?<![\w/.-])(?:{'|'.join(TOP)})/[\w./-]*\w")
DOC = re.compile(r"(?<![\w/.-])docs/[\w./-]+\.md(?:#[\w-]+)?")
DOTTED = re.compile(rf"(?<![\w/.-])(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+")
IMPORT = re.compile(rf"^from ((?:{'|'.join(PACKAGES)})[\w.]*) import (.+)$", re.MULTILINE)
SUFFIXES = {"py", "md", "toml", "xml", "json", "parquet", "npz", "csv"}

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


@cache
def anchors(page: Path) -> frozenset[str]:
    """Anchors that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    texts = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings]
    slugs = [re.sub(r"[^\w\- ]", "", text).replace(" ", "-") for text in texts]
    assert len(slugs) == len(set(slugs)), f"{page}: two headings of one name have numbered anchors"
    return frozenset(slugs)


def points_nowhere(target: str, page: Path) -> bool:
    path, _, anchor = unquote(target).partition("#")
    file = (page.parent / path).resolve() if path else page
    if not file.exists():
        return True
    return bool(anchor) and (file.suffix != ".md" or anchor not in anchors(file))


@cache
def names_of(module: str) -> frozenset[str]:
    """Names that a module defines or imports at its top level."""
    found: set[str] = set()
    file = module_files()[module]
    stub = file.with_suffix(".pyi")  # where public names are listed that are imported when they are used
    todo: list[ast.stmt] = ast.parse((stub if stub.is_file() else file).read_text(encoding="utf-8")).body
    todo += [node for branch in todo if isinstance(branch, ast.If) for node in branch.body]
    for node in todo:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {
                name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)
            }
    return frozenset(found)


def is_there(dotted: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        module = ".".join(parts[:length])
        if module in module_files():
            return length == len(parts) or parts[length] in names_of(module)
    return False


@pages
def test_links_lead_somewhere(page: Path) -> None:
    targets = LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8")))
    local = [target for target in targets if not re.match(r"[a-z]+:", target)]
    assert [target for target in local if points_nowhere(target, page)] == []


@pages
def test_files_that_are_mentioned_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    paths = set(PATH.findall(LINK.sub("]", text)))
    assert sorted(path for path in paths if not (ROOT / path).exists()) == []


@pages
def test_python_files_that_are_mentioned_exist(page: Path) -> None:
    """By their last parts, as ``linear/noise.py``."""
    known = [f"/{path.relative_to(ROOT).as_posix()}" for top in TOP for path in (ROOT / top).rglob("*.py")]
    named = {
        code for code in CODE.findall(page.read_text(encoding="utf-8")) if re.fullmatch(r"[\w/]+\.py", code)
    }
    assert sorted(n for n in named if not any(path.endswith(f"/{n}") for path in known)) == []


@pages
def test_modules_that_are_mentioned_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = {name for name in DOTTED.findall(text) if name.split(".")[-1] not in SUFFIXES}
    for module, names in IMPORT.findall(text):
        named |= {f"{module}.{name.split(' as ')[0].strip()}" for name in names.split("#")[0].split(",")}
    assert sorted(name for name in named if not is_there(name)) == []


@pytest.mark.parametrize("top", ["benchmarks", "scenarios"])
def test_what_programs_import_from_the_source_is_there(top: str) -> None:
    """No test runs them whole, and what they measure stands in the pages."""
    files = sorted((ROOT / top).rglob("*.py"))
    assert files
    named = [
        (file.name, f"{node.module}.{alias.name}")
        for file in files
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES
        for alias in node.names
    ]
    assert [f"{name}: {dotted}" for name, dotted in named if not is_there(dotted)] == []


def test_pages_that_the_code_mentions_exist() -> None:
    wrong = []
    for top in set(TOP) - {"docs"}:
        for file in sorted((ROOT / top).rglob("*")):
            if file.suffix in {".py", ".toml", ".xml", ".js", ".css"}:
                named = DOC.findall(file.read_text(encoding="utf-8"))
                wrong += [
                    f"{file.relative_to(ROOT)}: {n}" for n in named if points_nowhere(n, ROOT / "README.md")
                ]
    assert wrong == []


def rows_of(page: str, heading: str) -> list[tuple[str, str]]:
    """First cell, without backticks, and second one, of the table rows below a heading of a page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    section = re.split(r"^## ", text.split(f"\n## {heading}\n")[1], flags=re.MULTILINE)[0]
    return re.findall(r"^\| `(\w+)` \| (.+?) \|", section, re.MULTILINE)


def test_guide_lists_every_cause_with_its_family_and_tolerance() -> None:
    from discrepancy.team.causes import CAUSES, read_tolerances

    families = {cause: family for family, listed in rows_of("diagnosis/guide.md", "Families")
                for cause in CODE.findall(listed)}  # fmt: skip
    assert families == {name: cause.family for name, cause in CAUSES.items()}
    stated = dict(rows_of("diagnosis/guide.md", "Tolerances"))
    assert set(stated) == set(read_tolerances(None))
    for cause, tolerances in read_tolerances(None).items():
        numbers = re.findall(r"`(\w+)` (?:\.\.\. )?([\d.e-]+)", stated[cause])
        assert {name: float(value) for name, value in numbers}.items() <= tolerances.items(), cause
        assert len(numbers) == len(tolerances) or len(set(tolerances.values())) == 1, cause


def test_effects_lists_every_cause() -> None:
    from mocobot_sim.effects.catalogue import EFFECTS

    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    named = [
        name for cell in re.findall(r"^\| (`.+?`) \|", text, re.MULTILINE) for name in CODE.findall(cell)
    ]
    assert sorted(named) == sorted(EFFECTS)


def test_contributing_lists_every_package_and_no_other() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `src/([\w/]+)/` \|", page, re.MULTILINE)
    assert sorted(listed) == PACKAGES


def test_readme_leads_to_every_page() -> None:
    """What nothing links to, nobody reads."""
    linked: set[Path] = set()
    todo = [ROOT / "README.md"]
    while todo:
        page = todo.pop()
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            file = (page.parent / target.partition("#")[0]).resolve()
            if file.suffix == ".md" and file.is_file() and file not in linked:
                linked.add(file)
                todo.append(file)
    assert [str(page.relative_to(ROOT)) for page in PAGES if page.parent.name != "models"
            and (ROOT / "docs") in page.parents and page not in linked] == []  # fmt: skip
