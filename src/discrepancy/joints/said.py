"""Places and numbers of a robot of joints in words."""

from __future__ import annotations

import re
from dataclasses import dataclass

from discrepancy.numbers import Numbers, number

SLIDES = {
    "Nms_per_rad": "Ns_per_m", "Nm_per_rad": "N_per_m", "rad_per_Nm": "m_per_N", "rad_per_s": "m_per_s", "Nm": "N",
    "rad": "m", "kgm2": "kg",
}  # fmt: skip
"""Units in names, of a joint that turns and of one that slides."""
SHOWN = {
    "N m s/rad": "N s/m", "N m/rad": "N/m", "mrad per N m": "mm per N", "N m": "N", "mrad": "mm", "rad": "m",
    "rad/s": "m/s", "kg m^2": "kg",
}  # fmt: skip
"""The same as sentences show them."""


def parameter_name(name: str, *, slide: bool) -> str:
    """Name of a parameter with the unit of a joint that turns or slides."""
    for turning, sliding in SLIDES.items() if slide else ():
        if name.endswith(f"_{turning}"):
            return f"{name.removesuffix(turning)}{sliding}"
    return name


def joint_in_words(joint: int, called: str) -> str:
    """``joint 3 (elbow)``; the number alone where the name says no more."""
    plain = re.fullmatch(rf"(joint|j|axis|link)?[ _-]?0*{joint}", called, re.IGNORECASE)
    return f"joint {joint}" if plain or not called else f"joint {joint} ({called})"


def link_in_words(body: str) -> str:
    """``link hand``; the name alone where that says it is a link."""
    return body if re.search(r"\blink", body, re.IGNORECASE) else f"link {body}"


def titled(title: str, place: str = "") -> str:
    """A title such as ``friction in {joint}`` at its place; without one, wherever it is."""
    return re.sub(r"\{(.*?)\}", lambda part: place or _some(part[1]), title)


def _some(part: str) -> str:
    return "two joints" if part == "pair" else f"a {part}"


@dataclass(frozen=True)
class Said(Numbers):
    """Numbers of one cause, to be put into a sentence about its place.

    Attributes:
        place: in words.
        slide: whether its joint slides.
        than: what it is compared with, such as ``than modelled``.
    """

    place: str = ""
    slide: bool = False
    than: str = "than modelled"

    def __call__(self, name: str, unit: str, scale: float = 1.0, *, signed: bool = False) -> str:
        return super().__call__(self._name(name), self._unit(unit), scale, signed=signed)

    def either(self, name: str, more: str, less: str) -> str:
        return super().either(self._name(name), more, less)

    def value(self, name: str) -> float:
        """A number, by its name at a joint that turns; 0 where there is none."""
        return self.values.get(self._name(name), 0.0)

    def also(self, text: str, name: str, unit: str) -> str:
        """A text with a number that was chosen, not fitted, in place of ``{}``; nothing where there is none."""
        found = self.values.get(self._name(name))
        return "" if found is None else text.format(number(found, None, self._unit(unit)))

    def point(self, unit: str, scale: float) -> str:
        """``(x, y, z) unit``, of parameters such as ``x_m``."""
        names = [name for name in self.values if re.fullmatch(r"[xyz]_\w+", name)]
        return f"({', '.join(number(self.values[n], self.se.get(n), '', scale) for n in names)}) {unit}"

    def _name(self, name: str) -> str:
        sliding = parameter_name(name, slide=self.slide)
        return sliding if sliding in self.values else name

    def _unit(self, unit: str) -> str:
        return SHOWN.get(unit, unit) if self.slide else unit
