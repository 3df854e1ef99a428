"""Pictures in tests: made where the machine can render at all, and then they must be."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mocobot_view.camera import Camera
from mocobot_view.render import Picture, render


def made(pictures: list[Picture] | str) -> list[np.ndarray]:
    """Pictures as whole numbers; skips where not even an empty room can be rendered, and fails where it can."""
    if not isinstance(pictures, str):
        return [picture.astype(int) for picture in pictures]
    room = mujoco.MjModel.from_xml_string("<mujoco/>")
    words = render(room, [np.zeros(0)], Camera((0.0, 0.0, 0.0), 1.0, 0.0, 0.0), width=32, height=32)
    if isinstance(words, str):
        pytest.skip(words)
    raise AssertionError(pictures)
