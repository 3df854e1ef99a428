"""Units of quantities, names of trials, and units in texts."""

import re

from mocobot_report.blocks.numbers import spelled

QUANTITIES = {
    "speed": "m/s", "velocity": "m/s", "position": "m", "acceleration": "m/s²", "load": "N m", "force": "N",
    "temperature": "°C",
}  # fmt: skip
"""Units of what a misfit of a team may depend on."""
OF_JOINTS = {"speed": "typical speeds"}
"""Those that differ for a robot of joints."""


def short_names(names: list[str]) -> list[str]:
    """Trials without their folders and suffix, with running numbers where two are alike."""
    out: list[str] = []
    for name in names:
        stem = re.split(r"[/\\]", name)[-1].removesuffix(".parquet") or "trial"
        out.append(
            next(s for k in range(len(names) + 1) if (s := stem if not k else f"{stem} ({k + 1})") not in out)
        )
    return out


def spelled_text(text: str) -> str:
    """Text whose bracketed unit is printed with superscripts and does not break."""
    return re.sub(r"\[(.*?)\]", lambda m: f"[{spelled(m[1])}]", text)
