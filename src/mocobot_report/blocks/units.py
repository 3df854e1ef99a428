"""Names of parameters and quantities, and the units that they carry as suffixes."""

import re

from mocobot_report.blocks.numbers import spelled

TOKENS = {
    "Nm": "N m", "Nms": "N m s", "Ns": "N s", "mps": "m/s", "rad": "rad", "rad3": "rad³", "m": "m", "N": "N", "s": "s",
    "kg": "kg", "kgm": "kg m", "V": "V", "Vs": "V s", "Hz": "Hz", "deg": "deg", "m2": "m²",
}  # fmt: skip
QUANTITIES = {
    "speed": "m/s", "velocity": "m/s", "position": "m", "acceleration": "m/s²", "load": "N m", "force": "N",
    "temperature": "°C",
}  # fmt: skip
"""Units of what a misfit may depend on, as the rigs document them."""


def parameter(name: str) -> tuple[str, str]:
    """Name in words and unit: ``viscous_Nms_per_rad`` is ``viscous`` in ``N m s/rad``."""
    match = re.fullmatch(r"(.+?)_(?:([A-Za-z0-9]+)_)?per_([A-Za-z0-9]+)", name)
    if match and match[3] in TOKENS and (match[2] is None or match[2] in TOKENS):
        top = TOKENS[match[2]] if match[2] else "1"
        return match[1].replace("_", " "), f"{top}/{TOKENS[match[3]]}"
    head, _, last = name.rpartition("_")
    if head and last in TOKENS:
        return head.replace("_", " "), TOKENS[last]
    return name.replace("_", " "), ""


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
