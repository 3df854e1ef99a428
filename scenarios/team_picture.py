"""Render a team at rest to a PNG, off-screen: python scenarios/team_picture.py [a|b|c|d] [picture.png]"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from matplotlib.image import imsave

import mocobot
from mocobot.pictures import team_view


def main(payload: str, picture: Path) -> None:
    """Write a picture of the team in its home pose, or exit with the reason why there is none."""
    try:
        seen = team_view(payload)
    except mocobot.InputError as error:
        sys.exit(str(error))
    if isinstance(seen, str):
        sys.exit(seen)
    imsave(picture, seen)
    print(picture)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Render a team at rest to a PNG, without a screen.")
    parser.add_argument("payload", nargs="?", default="a", help="name of a shipped payload")
    parser.add_argument("picture", nargs="?", type=Path, help="team_PAYLOAD.png if not given")
    given = parser.parse_args()
    main(given.payload, given.picture or Path(f"team_{given.payload}.png"))
