"""The page around its content: head, themes, navigation, script, in one file that needs nothing else."""

from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files

from plotly.offline import get_plotlyjs

from mocobot_report.blocks import palette
from mocobot_report.blocks.html import Node, data_block, el, raw, variables, words
from mocobot_report.blocks.theme import TEMPLATES

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
    "form-action 'none'"
)
"""What the page may load: nothing but itself."""


def document(title: str, main: list[Node]) -> Node:
    """The whole page.

    Args:
        title: of the browser's window.
        main: sections; the first is the answer, the others have a heading and sections of their own.
    """
    style, script = page_assets()
    dark = f"color-scheme:dark;{variables(palette.DARK)}"
    colours = (
        f":root{{{variables(palette.LIGHT)}}}"
        f"@media (prefers-color-scheme: dark){{:root:not([data-theme=light]){{{dark}}}}}"
        f":root[data-theme=dark]{{{dark}}}"
        f"@media print{{:root:root:root{{color-scheme:light;{variables(palette.LIGHT)}}}}}"
    )
    foot = f"Made by mocobot {_version()}. This file is complete: it loads nothing from anywhere."
    return el(
        "html",
        el(
            "head",
            el("meta", charset="utf-8"),
            el("meta", name="generator", content="mocobot report"),
            el("title", f"{title} | mocobot report"),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", http_equiv="Content-Security-Policy", content=POLICY),
            el("link", rel="icon", href="data:,"),
            raw("style", colours + style),
        ),
        el(
            "body",
            el("a", "Skip to the results", href="#main", class_="skip"),
            el(
                "header",
                el("div", "mocobot ", el("span", "report"), class_="brand"),
                el("button", "Dark theme", type="button", id="theme"),
                class_="top",
            ),
            el(
                "div",
                _navigation(main),
                el(
                    "main",
                    el("noscript", el("p", "Plots need JavaScript; everything else on this page does not.")),
                    *main,
                    el("p", foot, class_="foot"),
                    id="main",
                    tabindex="-1",
                ),
                class_="frame",
            ),
            data_block("templates", {name: theme.to_plotly_json() for name, theme in TEMPLATES.items()}),
            raw("script", get_plotlyjs()),
            raw("script", script),
        ),
        lang="en",
    )


def page_assets() -> tuple[str, str]:
    """Style sheet and script of the page."""
    assets = files("mocobot_report").joinpath("assets")
    style, script = (assets.joinpath(name).read_text(encoding="utf-8") for name in ("style.css", "page.js"))
    return style, script


def _navigation(main: list[Node]) -> Node:
    """Links to every part and its sections."""
    entries = [el("li", el("a", "Answer", href="#answer"))]
    for part in main[1:]:
        inner = [el("li", _link(child, child[0])) for child in part if child.tag == "section"]
        entries.append(el("li", _link(part, part[0]), el("ol", *inner) if inner else None))
    return el("nav", el("p", "Contents", class_="contents"), el("ol", *entries), aria_label="Contents")


def _link(target: Node, heading: Node) -> Node:
    return el("a", words(heading), href=f"#{target.get('id')}")


def _version() -> str:
    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "from source"
