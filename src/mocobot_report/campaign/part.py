"""The part of the page on a blind campaign: what is found, from which size on, how often it lies."""

from __future__ import annotations

from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.charts import axis, chart, dots, figure, log_axis
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.prose import bullets, paragraph, verdict
from mocobot_report.blocks.tables import table
from mocobot_report.campaign.words import Json, background_words, sentences, share_words, tables
from mocobot_report.folder import Campaign

COLOURS = {"calibrated": "after", "uncalibrated": "before", "units": "after"}
SYMBOLS = {"calibrated": "circle", "uncalibrated": "square", "units": "circle"}
APART = 1.03
"""By how much a background's points are moved to the right, so that bars do not hide each other."""
PERCENT = {"range": [-4, 104], "fixedrange": True}


def title(campaign: Campaign) -> str:
    """What it is."""
    return "A blind campaign"


def answer(campaign: Campaign) -> list[Node]:
    """What was found, and what was named where nothing was."""
    head, *more = (sentence.replace(" %", "\u00a0%") for sentence in sentences(campaign.values))
    out = [paragraph(head, kind="lede"), bullets(more)]
    if failed := campaign.values["sets"]["failed"]:
        last = [f"{entry['key']}: {str(entry['error']).strip().splitlines()[-1]}" for entry in failed]
        out.append(verdict("warn", f"{len(failed)} sets were not diagnosed", bullets(last)))
    return out


def sections(book: Book, campaign: Campaign) -> list[Node]:
    """Everything below the answer: plots, then every table."""
    book.say("campaign")
    values = campaign.values
    charts = [_found(book, values)] if values["found"] else []
    charts += [_reliable(book, values)] if values["reliability"]["bins"] else []
    out = [section(book, "At a glance", *charts)] if charts else []
    for name, heads, rows in tables(values):
        first, _, note = name.partition(": ")
        out.append(section(book, first, table(first, heads, rows, note=note)))
    return out


def _bars(shares: list[Json]) -> dict[str, object]:
    """Error bars of shares [%]."""
    at = [100 * share["hits"] / share["of"] for share in shares]
    low, high = ([100 * share["interval"][k] for share in shares] for k in (0, 1))
    return {
        "type": "data", "symmetric": False, "thickness": 1.3, "width": 3,
        "array": [b - a for a, b in zip(at, high, strict=True)],
        "arrayminus": [a - b for a, b in zip(at, low, strict=True)],
    }  # fmt: skip


def _found(book: Book, values: Json) -> Node:
    keys, traces = [], []
    for k, background in enumerate(dict.fromkeys(entry["background"] for entry in values["found"])):
        own = [entry for entry in values["found"] if entry["background"] == background]
        shares = [entry["right"] for entry in own]
        key = Key(background, background_words(background), COLOURS[background], SYMBOLS[background])
        text = [f"{entry['factor']:g} times the limit: {share_words(entry['right'])}" for entry in own]
        x = [entry["factor"] * APART**k for entry in own]
        y = [100 * share["hits"] / share["of"] for share in shares]
        keys.append(key)
        traces.append(dots(x, y, key, text, error_y=_bars(shares)))
    sizes = [entry["factor"] for entry in values["found"]]
    shown = figure(
        traces, xaxis=log_axis("size over the detection limit", sizes), yaxis=axis("right [%]", **PERCENT)
    )
    return chart(
        book, "Cause and place right, by size", shown, height=320, keys=keys, note="bars: 95 % intervals",
        label="Share of sets in which cause and place were right, by size; values are in the table below.",
    )  # fmt: skip


def _reliable(book: Book, values: Json) -> Node:
    bins, key = values["reliability"]["bins"], Key("named", "causes named", "after", "circle")
    shares = [entry["right"] for entry in bins]
    text = [f"{100 * entry['mean']:.0f} % said: {share_words(entry['right'])}" for entry in bins]
    x = [100 * entry["mean"] for entry in bins]
    y = [100 * share["hits"] / share["of"] for share in shares]
    shown = figure(
        [dots(x, y, key, text, error_y=_bars(shares))],
        xaxis=axis("probability stated [%]", **PERCENT), yaxis=axis("right [%]", **PERCENT),
    )  # fmt: skip
    shown.add_shape(type="line", x0=0, y0=0, x1=100, y1=100)
    return chart(
        book, "Stated probabilities", shown, height=340, keys=[key],
        note="bars: 95 % intervals; the line is where the stated probability holds",
        label="Share of named causes that were right, by stated probability; values are in the table below.",
    )  # fmt: skip
