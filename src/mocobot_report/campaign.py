"""Sentences, tables and plots from the summary of a blind campaign (``campaign.json``), for text and page."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mocobot_report.charts import Axis, Chart, Key, Trace, axis, dots, log_axis

if TYPE_CHECKING:
    from mocobot_report.folder import Result

BACKGROUNDS = {
    "calibrated": ("Calibrated robots", "after", "circle"),
    "uncalibrated": ("Uncalibrated robots", "before", "square"),
    "units": ("The given robots", "after", "circle"),
}
"""Name, colour and marker of each kind of robots."""
APART = 1.03
"""Factor by which the points of each further background are shifted to the right, so that bars do not overlap."""
Json = Mapping[str, Any]


def sentences(summary: Json) -> list[str]:
    sets = summary["sets"]
    out = [
        f"{sets['diagnosed']} sets diagnosed, of {sets['clean']} in which nothing was hidden and {sets['hidden']} in "
        "which one effect was."
    ]
    for entry in summary["found"]:
        out.append(
            f"{background_words(entry['background'])}, {entry['factor']:g} times the detection limit: cause and place "
            f"right in {share_words(entry['right'])}."
        )
    for entry in summary["false_alarms"]:
        out.append(
            f"{background_words(entry['background'])}, nothing hidden: something named in "
            f"{share_words(entry['alarms'])}."
        )
    if (stated := summary["reliability"])["number"]:
        out.append(
            f"Of {stated['number']} causes named, {stated['right']} were right; Brier score of the stated "
            f"probabilities {stated['brier']:.3f} (0 is best; saying 50 % of everything gets 0.25)."
        )
    return out


def background_words(background: str) -> str:
    return BACKGROUNDS[background][0]


def share_words(share: Json) -> str:
    """Format counts and interval of a share, such as ``7 of 12 (28 to 85 %)``."""
    if not share["of"]:
        return "none"
    low, high = (100.0 * value for value in share["interval"])
    return f"{share['hits']} of {share['of']} ({low:.0f} to {high:.0f} %)"


def tables(summary: Json) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return title, column heads and rows of every table with rows."""
    every = [
        (
            "Detection limits: median over teams and places, and range",
            ["robots", "cause", "parameter", "median", "smallest", "largest", "seen at"],
            _limits(summary["limits"]),
        ),
        (
            "Found, by size over the detection limit (95 % interval)",
            ["robots", "size", "cause and place", "cause", "missed", "something besides"],
            [
                [entry["background"], f"{entry['factor']:g}",
                 *(share_words(entry[k]) for k in ("right", "cause", "missed", "extras"))]
                for entry in summary["found"]
            ],
        ),
        (
            "Found, by cause",
            ["hidden", "cause and place", "missed", "median error", "error over its standard error, rms"],
            [
                [entry["cause"], share_words(entry["right"]), share_words(entry["missed"]),
                 _number(entry["error"], 100.0, " %"), _number(entry["over_se"])]
                for entry in summary["causes"]
            ],
        ),
        ("Confusion: hidden, and named for it", ["hidden", "named"], _confusion(summary["confusion"])),
        (
            "False alarms: sets in which nothing was hidden",
            ["robots", "something named", "what", "verdicts"],
            [
                [entry["background"], share_words(entry["alarms"]), _counts(entry["named"]),
                 _counts(entry["verdicts"])]
                for entry in summary["false_alarms"]
            ],
        ),
        (
            "Stated probabilities",
            ["stated", "mean", "right", "within the interval"],
            [_bin(entry) for entry in summary["reliability"]["bins"]],
        ),
    ]  # fmt: skip
    return [(title, heads, rows) for title, heads, rows in every if rows]


def _limits(limits: Sequence[Json]) -> list[list[str]]:
    rows = []
    for entry in limits:
        seen = f"{entry['seen']} of {entry['places']}"
        if not entry["parameters"]:
            rows.append([entry["background"], entry["cause"], "-", "not seen", "", "", seen])
        for name, sizes in entry["parameters"].items():
            numbers = [f"{sizes[key]:.2g}" for key in ("median", "low", "high")]
            rows.append([entry["background"], entry["cause"], name, *numbers, seen])
    return rows


def _confusion(confusion: Json) -> list[list[str]]:
    rows = []
    for hidden, counts in zip(confusion["hidden"], confusion["counts"], strict=True):
        named = {name: n for name, n in zip(confusion["named"], counts, strict=True) if n}
        rows.append([hidden, _counts(named)])
    return rows


def _bin(entry: Json) -> list[str]:
    low, high = entry["right"]["interval"]
    return [
        f"{100 * entry['low']:.0f} to {100 * entry['high']:.0f} %", f"{100 * entry['mean']:.1f} %",
        share_words(entry["right"]), "yes" if low <= entry["mean"] <= high else "no",
    ]  # fmt: skip


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {n}" for name, n in counts.items()) or "-"


def _number(value: float | None, scale: float = 1.0, unit: str = "") -> str:
    return "-" if value is None else f"{scale * value:.2g}{unit}"


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/campaign.html``."""
    say("campaign")
    values = result.found
    charts = [_found_chart(values)] if values["found"] else []
    charts += [_reliability_chart(values["reliability"]["bins"])] if values["reliability"]["bins"] else []
    failed = values["sets"]["failed"]
    return {
        "title": "A blind campaign",
        "said": [sentence.replace(" %", "\u00a0%") for sentence in sentences(values)],
        "failed": [f"{entry['key']}: {str(entry['error']).strip().splitlines()[-1]}" for entry in failed],
        "charts": charts,
        "tables": [(*name.partition(": ")[::2], heads, rows) for name, heads, rows in tables(values)],
    }


def _found_chart(values: Json) -> Chart:
    keys, data = [], []
    for k, background in enumerate(dict.fromkeys(entry["background"] for entry in values["found"])):
        own = [entry for entry in values["found"] if entry["background"] == background]
        key = Key(background, *BACKGROUNDS[background])
        text = [f"{entry['factor']:g} times the limit: {share_words(entry['right'])}" for entry in own]
        keys.append(key)
        data.append(_shares([entry["factor"] * APART**k for entry in own], own, key, text))
    across = log_axis("size over the detection limit", [entry["factor"] for entry in values["found"]])
    return Chart(
        "Cause and place right, by size",
        "Share of sets in which cause and place were right, by size; values are in the table below.",
        data, {"xaxis": across, "yaxis": _percent_axis("right [%]")}, 320, keys, "bars: 95 % intervals",
    )  # fmt: skip


def _reliability_chart(bins: Sequence[Json]) -> Chart:
    key = Key("named", "causes named", "after", "circle")
    text = [f"{100 * entry['mean']:.0f} % said: {share_words(entry['right'])}" for entry in bins]
    diagonal = {"type": "line", "x0": 0, "y0": 0, "x1": 100, "y1": 100}
    axes = {"xaxis": _percent_axis("probability stated [%]"), "yaxis": _percent_axis("right [%]")}
    return Chart(
        "Stated probabilities",
        "Share of named causes that were right, by stated probability; values are in the table below.",
        [_shares([100 * entry["mean"] for entry in bins], bins, key, text)], axes | {"shapes": [diagonal]}, 340, [key],
        "bars: 95 % intervals; the line is where the stated probability holds",
    )  # fmt: skip


def _shares(x: Sequence[float], entries: Sequence[Json], key: Key, text: Sequence[str]) -> Trace:
    """Plot the shares of right answers [%] with their intervals."""
    shares = [entry["right"] for entry in entries]
    at = [100 * share["hits"] / share["of"] for share in shares]
    low, high = ([100 * share["interval"][k] for share in shares] for k in (0, 1))
    interval = {
        "type": "data", "symmetric": False, "thickness": 1.3, "width": 3,
        "array": [b - a for a, b in zip(at, high, strict=True)],
        "arrayminus": [a - b for a, b in zip(at, low, strict=True)],
    }  # fmt: skip
    return dots(x, at, key, text, error_y=interval)


def _percent_axis(title: str) -> Axis:
    return axis(title, range=[-4, 104], fixedrange=True)
