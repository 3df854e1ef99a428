"""Render a team at rest to a PNG, without a screen: python scenarios/team_picture.py [a|b|c|d] [picture.png]"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.image import imsave

import mocobot
from mocobot.pictures import team_view


def main(payload: str, picture: Path) -> None:
    """Write a picture of the team in its home pose, or say why there is none."""
    try:
        seen = team_view(payload)
    except mocobot.InputError as error:
        sys.exit(str(error))
    if isinstance(seen, str):
        sys.exit(seen)
    imsave(picture, seen)
    print(picture)


if __name__ == "__main__":
    name = sys.argv[1] if len(sys.argv) > 1 else "a"
    main(name, Path(sys.argv[2] if len(sys.argv) > 2 else f"team_{name}.png"))
