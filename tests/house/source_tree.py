"""The source tree as its imports have it."""

from __future__ import annotations

import ast
from pathlib import Path

SRC = Path(__file__).resolve().parents[2] / "src"


def module_files(package: str = "") -> dict[str, Path]:
    """Every module of a package (of all, if none is named) and its file."""
    top = SRC.joinpath(*package.split(".")) if package else SRC
    named = {path: path.relative_to(SRC).with_suffix("").parts for path in sorted(top.rglob("*.py"))}
    return {".".join(parts).removesuffix(".__init__"): path for path, parts in named.items()}


def imported_modules(path: Path) -> set[str]:
    """Full names of the modules that a file imports, and of what it takes from them."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None and not node.level, f"{path}: relative import"  # noqa: PT018
            modules |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


def project_imports() -> dict[str, set[str]]:
    """Modules of the project, and which of them each imports; a package's own ``__init__`` counts for its modules."""
    files = module_files()
    graph = {}
    for module, path in files.items():
        taken = imported_modules(path) & set(files)
        # ``from package import module`` needs the module, not what the package's face hands on.
        graph[module] = {
            name for name in taken if not any(other.startswith(f"{name}.") for other in taken)
        } - {module}
    return graph
