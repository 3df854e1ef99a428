"""PyMJCF (``dm_control.mjcf``), imported without a renderer.

dm_control loads a renderer when it is imported, and warns or fails without a display; composing needs none.
"""

from __future__ import annotations

import os

_renderer = os.environ.get("MUJOCO_GL")
os.environ["MUJOCO_GL"] = "disabled"
try:
    from dm_control import mjcf
finally:
    del os.environ["MUJOCO_GL"]
    if _renderer is not None:
        os.environ["MUJOCO_GL"] = _renderer

__all__ = ["mjcf"]
