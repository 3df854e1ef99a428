"""The report in a headless Chromium: loads alone, draws, fits a phone, readable in both themes, works by keyboard."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from chromium import DESKTOP, PHONE, Seen, browser_running, opened
from mocobot_report.page import write_report
from report_folders import NASTY, calibration_folder, diagnosis_folder, estimate_folder, paper_folder

pytestmark = pytest.mark.slow

MAKE: dict[str, Callable[[Path], Path]] = {
    "paper": paper_folder,
    "estimate": estimate_folder,
    "diagnosis": diagnosis_folder,
    "calibration": calibration_folder,
    "robot": lambda folder: diagnosis_folder(folder, "consistent", robot=True),
}


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with browser_running() as running:
        yield running


@pytest.fixture(scope="module")
def pages(browser: object, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("results")
    return {kind: write_report(make(folder / kind)) for kind, make in MAKE.items()}


@pytest.mark.parametrize("kind", MAKE)
@pytest.mark.parametrize(("size", "scheme"), [(DESKTOP, "light"), (PHONE, "dark")])
def test_page_is_quiet_whole_and_readable(
    browser: object, pages: dict[str, Path], kind: str, size: tuple[int, int], scheme: str
) -> None:
    with opened(browser, pages[kind], size, color_scheme=scheme) as seen:
        seen.draw_all()
        assert seen.said == []
        assert [url for url in seen.asked if not url.startswith(("data:", "blob:"))] == [pages[kind].as_uri()]
        _check_plots(seen)
        _check_markup(seen)
        assert seen.page.locator("script:not(head script)").count() == 3
        if kind != "paper":  # what a file's name or label holds is shown, not obeyed
            assert NASTY[:30] in seen.page.evaluate("document.querySelector('main').textContent")
        assert seen.page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert seen.page.evaluate("document.body.scrollWidth") <= size[0]
        contrast = seen.page.evaluate("checks.contrast()")
        assert contrast["bad"] == []
        assert contrast["count"] > 100
        dark = seen.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(15, 20, 26)"
        assert dark == (scheme == "dark")


def _check_plots(seen: Seen) -> None:
    """Every plot has marks in it, inside its own box, and no text of its axes is cut off."""
    plots = seen.page.evaluate("checks.plots()")
    assert plots
    for plot in plots:
        assert plot["drawn"] > 0, plot
        assert plot["outside"] == [], plot
    assert (
        seen.page.locator(".modebar-btn").count() == 0
    )  # nothing covers data, nothing leads out of the page
    assert seen.page.locator('a[href^="http"]').count() == 0


def _check_markup(seen: Seen) -> None:
    """Landmarks, headings, names of everything, and no id twice."""
    found = seen.page.evaluate("checks.markup()")
    assert found == {
        "h1": 1, "main": 1, "nav": 1, "lang": "en", "twice": [], "skipped": [], "captions": 0, "scopes": 0, "alts": 0,
        "plots": 0, "inputs": 0, "broken": 0,
    }  # fmt: skip
    assert seen.page.title().endswith("| mocobot report")


def test_keyboard_reaches_everything(browser: object, pages: dict[str, Path]) -> None:
    with opened(browser, pages["diagnosis"], PHONE, reduced_motion="reduce") as seen:
        page = seen.page
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        assert page.evaluate("document.activeElement.getBoundingClientRect().top") >= 0
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main"

        page.reload()
        visited = []
        for _ in range(400):
            page.keyboard.press("Tab")
            at = page.evaluate("checks.focus()")
            if at is None or (visited and at[0] == visited[0]):
                break
            assert at[1], f"focus on {at[0]} does not show"
            visited.append(at[0])
        assert visited[:2] == ["skip", "theme"]
        kinds = page.evaluate(
            """() => ['nav a', '.legend button', '.tabs input:checked', '.scroll[tabindex]', 'summary'].map((css) =>
                 [...document.querySelectorAll(css)].filter((e) => e.checkVisibility()).length)"""
        )
        assert all(count > 0 for count in kinds)
        assert len(visited) >= sum(kinds)


def test_theme_legend_and_tabs_by_keyboard(browser: object, pages: dict[str, Path]) -> None:
    with opened(browser, pages["diagnosis"], color_scheme="light") as seen:
        page = seen.page
        seen.draw_all()
        page.reload()
        page.locator("#theme").focus()
        page.keyboard.press("Enter")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(15, 20, 26)"
        assert page.locator("#theme").inner_text() == "Light theme"

        button = page.locator(".legend button").first
        button.scroll_into_view_if_needed()
        plot = button.locator("xpath=ancestor::figure").locator(".plot")
        page.wait_for_function("(p) => p.dataset.drawn", arg=plot.element_handle())
        traces = plot.locator(".trace")
        before = traces.count()
        text = plot.locator(".ytick text").first
        assert (
            text.evaluate("(t) => getComputedStyle(t).fill") == "rgb(169, 181, 195)"
        )  # drawn in the dark theme
        button.focus()
        page.keyboard.press("Space")
        assert button.get_attribute("aria-pressed") == "false"
        page.wait_for_function(
            "([p, n]) => p.querySelectorAll('.trace').length < n", arg=[plot.element_handle(), before]
        )

        tabs = page.locator(".tabs").first
        first, second = (tabs.locator("input").nth(k) for k in (0, 1))
        panels = [page.locator(f"#{box.get_attribute('value')}") for box in (first, second)]
        assert [panel.is_visible() for panel in panels] == [True, False]
        first.focus()
        page.keyboard.press("ArrowRight")
        assert [panel.is_visible() for panel in panels] == [False, True]
        drawn = panels[1].locator(".plot[data-drawn]").first
        drawn.wait_for(state="attached", timeout=5000)
        assert seen.said == []


def test_phones_show_what_tables_hold(browser: object, pages: dict[str, Path]) -> None:
    """Rows with long names stack and fit; other tables fade where they go on, say so, and stop at the end."""
    with opened(browser, pages["diagnosis"], PHONE) as seen:
        page = seen.page
        seen.draw_all()
        stacked = page.evaluate(
            """() => [...document.querySelectorAll('.stack')].map((box) => [box.scrollWidth - box.clientWidth,
                 box.querySelector('tbody td').checkVisibility(), box.querySelector('table').getAttribute('role')])"""
        )
        assert len(stacked) >= 5
        assert {tuple(one) for one in stacked} == {(0, True, "table")}
        value = page.locator(".stack td.num").first
        assert value.inner_text().replace("\u00a0", " ") == "0.0500 ± 0.0010 N m"
        box = value.bounding_box()
        assert box["x"] + box["width"] < PHONE[0]
        wide = page.locator(".scroll.more").first.element_handle()
        assert "scroll sideways" in wide.inner_text()
        assert "gradient" in wide.evaluate("(b) => getComputedStyle(b).maskImage")
        wide.evaluate("(b) => { b.scrollLeft = b.scrollWidth; }")
        page.wait_for_function(
            "(b) => b.classList.contains('before') && !b.classList.contains('more')", arg=wide
        )
    with opened(browser, pages["diagnosis"], DESKTOP) as seen:
        seen.draw_all()
        assert seen.page.locator(".scroll.more:visible").count() == 0


def test_tables_are_there_without_scripts(browser: object, pages: dict[str, Path]) -> None:
    with opened(browser, pages["diagnosis"], java_script_enabled=False) as seen:
        assert "Plots need JavaScript" in seen.page.locator("noscript").inner_text()
        assert seen.page.locator("table").first.is_visible()
        assert seen.page.locator("[data-panel]").last.is_visible()
