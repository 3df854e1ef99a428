"""Colours and sizes shared by scene, plots and summary."""

import colorsys

FORCE_M_PER_N = 0.006  # length of a force arrow per newton [m/N]. Chosen.
FRAME_M = 0.10  # length of the axes of a frame [m]. Chosen.
MARK_M = 0.06  # radius of the ball that marks a cause [m]. Chosen.


Colour = tuple[int, int, int]

ROBOTS: tuple[Colour, ...] = (
    (31, 119, 180), (230, 115, 10), (44, 150, 60), (148, 90, 190), (140, 86, 75), (215, 90, 175),
)  # fmt: skip
"""Colours of robots 1, 2, 3, ...; they repeat."""
ESTIMATE: Colour = (225, 20, 110)
TRUTH: Colour = (0, 140, 90)
COMMAND: Colour = (250, 250, 250)
FAULT: Colour = (230, 0, 20)
AXES: tuple[Colour, ...] = ((220, 40, 40), (40, 160, 40), (50, 80, 225))
"""Colours of the axes x, y, z of a frame."""


def of_robot(robot: int) -> Colour:
    """Return the colour of a robot; robots count from 1."""
    return ROBOTS[(robot - 1) % len(ROBOTS)]


def shades(robot: int, saturation: float = 1.0) -> list[Colour]:
    """Return three shades of a robot's colour for its joints or axes 1, 2, 3: dark, plain, light.

    Robots count from 1; ``saturation`` below 1 is for reference curves.
    """
    h, _, s = colorsys.rgb_to_hls(*(part / 255.0 for part in of_robot(robot)))
    return [_bytes(colorsys.hls_to_rgb(h, lightness, saturation * s)) for lightness in (0.36, 0.55, 0.78)]


def pale(colour: Colour) -> Colour:
    """Return a light shade of a colour, for text on the viewer's dark labels."""
    h, lightness, s = colorsys.rgb_to_hls(*(part / 255.0 for part in colour))
    return _bytes(colorsys.hls_to_rgb(h, lightness + 0.8 * (1.0 - lightness), s))


def _bytes(rgb: tuple[float, float, float]) -> Colour:
    red, green, blue = (round(255.0 * part) for part in rgb)
    return red, green, blue
