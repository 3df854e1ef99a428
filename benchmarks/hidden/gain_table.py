"""What named causes are worth, as a Markdown table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

CHANNELS = (("phi", 1e3, "mrad"), ("theta", 1e3, "mrad"), ("tau", 1e3, "mN m"))
ERRORS = (("mass_percent", "mass [%]"), ("com_mm", "CoM [mm]"), ("principal_inertia_percent", "inertia [%]"))


def gain_table(results: Iterable[Mapping[str, Any]]) -> str:
    """One row per set: closed-loop errors on held-out trials and errors of the estimate, before -> after."""
    header = [
        "hidden", "named", *(f"{name} [{unit}]" for name, _, unit in CHANNELS), "chi2/n", "excess removed",
        *(label for _, label in ERRORS), "scan, whole [s]",
    ]  # fmt: skip
    rows = [header, ["---"] * len(header), *map(_row, results)]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _row(result: Mapping[str, Any]) -> list[str]:
    hidden = result["hidden"]
    before, after = (result["gain"]["held_out"][name] for name in ("before", "after"))
    removed = result["gain"]["removed"]
    share = "-"
    if removed is not None:
        low, high = removed["interval"]
        share = f"{100 * removed['share']:.0f} %" + (
            "" if low is None else f" ({100 * low:.0f} .. {100 * high:.0f})"
        )
    named = [_place(cause) for cause in result["causes"]]
    sizes = ", ".join(f"{name} {value:.3g}" for name, value in hidden["parameters"].items())
    return [
        f"{_place(hidden)} ({result['payload']}): {sizes}",
        "right" if named == [_place(hidden)] else ", ".join(named) or result["verdict"],
        *(
            f"{k * before[f'{name}_rms']:.3g} -> {k * after[f'{name}_rms']:.3g}"
            f" ({k * result['gain']['noise'][f'{name}_rms']:.2g})"
            for name, k, _ in CHANNELS
        ),
        f"{before['chi2_per_n']:.3g} -> {after['chi2_per_n']:.3g}",
        share,
        *(
            f"{result['errors']['before'][key]:.2g} -> {result['errors']['after'][key]:.2g}"
            for key, _ in ERRORS
        ),
        f"{result['scan_s']:.0f}, {result['whole_s']:.0f}",
    ]


def _place(item: Mapping[str, Any]) -> str:
    return "/".join(str(item[key]) for key in ("cause", "robot", "joint") if item.get(key) is not None)
