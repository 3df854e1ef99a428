"""Every set that was not found right, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hidden.campaign import failed


def failures(results: Iterable[Mapping[str, Any]]) -> str:
    """One paragraph per set: what was hidden, what was named."""
    out = []
    for result in results:
        if not failed(dict(result)):
            continue
        lines = [f"{result['part']} {result['key']} (engine {result['engine']})"]
        if result["error"]:
            lines.append(f"  {result['error'].strip().splitlines()[-1]}")
            out.append("\n".join(lines))
            continue
        truth, verdict = result["truth"], result["verdict"]
        lines[0] += f", payload {truth['payload']}"
        lines += [f"  hidden {_item(effect)}" for effect in truth["effects"]]
        for item in verdict["found"]:
            rivals = ", ".join(f"{_place(rival)} {rival['gap']:.1f}" for rival in item["rivals"])
            lines.append(
                f"  found  {_item(item)} P {item['probability']:.3f} left {item['share_left']:.2f} "
                f"in {item['in_sample']:.2f} out {item['held_out']} rivals [{rivals}]"
            )
        lines.append(
            f"  chi2/n {verdict['before']:.3f} -> {verdict['after']:.3f}, explained {verdict['explained']:.2f}, "
            f"unlisted {verdict['unlisted_nats']:.1f} nats, suspected {verdict['suspected']}, scatter "
            f"{verdict['scatter']}, {verdict['seconds']:.0f} s"
        )
        out.append("\n".join(lines))
    return "\n".join(out)


def _item(item: Mapping[str, Any]) -> str:
    return f"{_place(item)} " + ", ".join(f"{k} {v:.4g}" for k, v in item["parameters"].items())


def _place(item: Mapping[str, Any]) -> str:
    return "/".join(str(item[key]) for key in ("cause", "robot", "joint") if item.get(key) is not None)
