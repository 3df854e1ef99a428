"""What MkDocs needs besides docs/: README and the models' pages at their places, the reference, and links that hold.

Pages link as they do in the repository, so that they work there, too. Where a link leads out of the pages (to a source
file, a folder), its text stays.
"""

from __future__ import annotations

import ast
import json
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"(^```.*?^```)", re.DOTALL | re.MULTILINE)
REFERENCE = {
    "Recordings, teams and trials": (
        "mocobot.api.simulation", "estimator.recording", "mocobot_sim.trial", "mocobot_sim.scene",
        "mocobot_sim.effects",
    ),
    "Estimate, calibrate, compare": ("mocobot.api.estimation", "mocobot.api.calibration", "mocobot.api.comparison"),
    "Options": ("mocobot.options",),
    "Inspect and diagnose": ("mocobot.api.inspection", "mocobot.api.diagnosis", "mocobot.api.watch"),
    "Convert and replay": ("mocobot.api.conversion", "mocobot.api.replay", "estimator.inputs"),
    "Errors": ("estimator.errors", "mocobot_sim.errors"),
}  # fmt: skip
"""Pages of the reference, and where the modules are whose public names they show; mocobot's own modules have theirs."""
NAV = {
    "Start": [
        "index.md",
        "tutorials/arm.md",
        "commands/README.md",
        "commands/performance.md",
        "notation.md",
        "model.md",
        "models",
    ],
    "Simulate": ["simulation.md", "base.md", "effects.md"],
    "Logs": ["recording.md", "measured-data.md", "inspect.md", "commands/watch.md"],
    "Estimate": ["method.md", "payloads.md", "method-arm.md", "paper.md"],
    "Calibrate": ["calibration.md", "calibration"],
    "Diagnose": ["diagnosis", "serial", "commands/campaign.md"],
    "Show": ["replay.md", "report.md", "commands/comparison.md", "commands/cluster.md"],
    "Learn": ["tutorials"],
    "Python": ["api.md", "reference"],
}


def on_files(files: Files, config: Any) -> Files:
    """Add README, the models' pages and the reference."""
    pages = {"index.md": ROOT / "README.md", "models/index.md": ROOT / "models" / "README.md"}
    pages |= {f"models/{path.parent.name}.md": path for path in sorted(ROOT.glob("models/*/README.md"))}
    for uri, path in pages.items():
        at = path.relative_to(ROOT).as_posix()
        files.append(File.generated(config, uri, content=_moved(path.read_text(encoding="utf-8"), at)))
    for path in sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")):
        files.append(File.generated(config, f"tutorials/{path.stem}.md", content=_notebook(path)))
    for uri, content in _reference().items():
        files.append(File.generated(config, uri, content=content))
    config.nav = _nav([file.src_uri for file in files.documentation_pages()])
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links of the pages of docs/."""
    if page.file.generated_by:
        return markdown
    return _moved(markdown, f"docs/{page.file.src_uri}")


def _moved(text: str, at: str) -> str:
    """Links of a page that is ``at`` in the repository, for its place on the site."""
    here = _uri(at) or at

    def moved(match: re.Match[str]) -> str:
        mark, words, target = match.groups()
        if re.match(r"\w+:|#", target):
            return match[0]
        path, hash_, anchor = target.partition("#")
        there = posixpath.normpath(posixpath.join(posixpath.dirname(at), path))
        uri = _uri(there)
        if uri is None:
            return words
        return f"{mark}[{words}]({posixpath.relpath(uri, posixpath.dirname(here) or '.')}{hash_}{anchor})"

    parts = FENCE.split(text)
    return "".join(part if part.startswith("```") else LINK.sub(moved, part) for part in parts)


def _uri(path: str) -> str | None:
    """Place on the site of a file of the repository, or None if it has none."""
    if path == "README.md":
        return "index.md"
    if path == "models/README.md":
        return "models/index.md"
    if match := re.fullmatch(r"models/(\w+)/README\.md", path):
        return f"models/{match[1]}.md"
    if path.startswith("docs/tutorials/") and path.endswith(".ipynb"):
        return path.removeprefix("docs/").replace(".ipynb", ".md")
    if path.startswith("docs/") and not path.startswith("docs/site/") and (ROOT / path).is_file():
        return path.removeprefix("docs/")
    return None


def _notebook(path: Path) -> str:
    """A notebook's words, code and kept outputs as a page."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        parts += [
            f"```text\n{''.join(output['text'])}\n```"
            for output in cell.get("outputs", ())
            if "text" in output
        ]
    return "\n\n".join(parts)


def _reference() -> dict[str, str]:
    """Pages on the public names, by what ``mocobot`` says is public."""
    source = (ROOT / "src" / "mocobot" / "__init__.pyi").read_text(encoding="utf-8")
    out: dict[str, str] = {}
    left: dict[str, list[str]] = {}
    for home, name in re.findall(r"^from (\S+) import (\w+) as", source, re.MULTILINE):
        left.setdefault(home, []).append(name)
    for title, prefixes in REFERENCE.items():
        blocks = [f"# {title}", ""]
        for home in [home for prefix in prefixes for home in left if f"{home}.".startswith(f"{prefix}.")]:
            blocks += [f"::: {home}.{name}" for name in left.pop(home)]
        out[f"reference/{title.lower().replace(',', '').replace(' ', '-')}.md"] = "\n\n".join(blocks) + "\n"
    for name in left.pop("mocobot"):
        out[f"reference/mocobot.{name}.md"] = f"# mocobot.{name}\n\n{_module(name)}\n"
    assert not left, f"no page of the reference has {left}"
    return out


def _module(name: str) -> str:
    """What a public module says and offers: names that it defines, or takes from elsewhere."""
    tree = ast.parse((ROOT / "src" / "mocobot" / f"{name}.py").read_text(encoding="utf-8"))
    homes = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    public = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
    )
    blocks = [f"::: {homes.get(each, f'mocobot.{name}.{each}')}" for each in public]
    return "\n\n".join([ast.get_docstring(tree) or "", *blocks])


def _nav(uris: list[str]) -> list[dict[str, Any]]:
    """The table of contents: pages and folders of ``NAV``, every page once."""
    out, seen = [], set()
    for title, entries in NAV.items():
        listed = [
            uri
            for entry in entries
            for uri in sorted(set(uris) - seen)
            if uri == entry or uri.startswith(f"{entry}/")
        ]
        seen.update(listed)
        out.append({title: listed})
    assert set(uris) == seen, f"no part of the contents has {sorted(set(uris) - seen)}"
    return out
