"""What a campaign's summary (``campaign.json``) says, as sentences and tables, for text and page."""

from collections.abc import Mapping, Sequence
from typing import Any

FORMAT = "mocobot-campaign"
BACKGROUNDS = {
    "calibrated": "Calibrated robots",
    "uncalibrated": "Uncalibrated robots",
    "units": "The given robots",
}


Json = Mapping[str, Any]


def sentences(summary: Json) -> list[str]:
    """The answer."""
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
    """What robots they are."""
    return BACKGROUNDS[background]


def share_words(share: Json) -> str:
    """``7 of 12 (28 to 85 %)``: counts and interval."""
    if not share["of"]:
        return "none"
    low, high = (100.0 * value for value in share["interval"])
    return f"{share['hits']} of {share['of']} ({low:.0f} to {high:.0f} %)"


def tables(summary: Json) -> list[tuple[str, list[str], list[list[str]]]]:
    """Title, heads and rows of every table that has rows."""
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
                [
                    entry["background"],
                    f"{entry['factor']:g}",
                    *(share_words(entry[k]) for k in ("right", "cause", "missed", "extras")),
                ]
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
