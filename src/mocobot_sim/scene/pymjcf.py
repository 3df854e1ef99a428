"""PyMJCF (``dm_control.mjcf``), imported without a renderer.

dm_control loads a renderer when it is imported, and warns or fails without a display; composing needs none.
"""

import os

import mujoco

_renderer = os.environ.get("MUJOCO_GL")
os.environ["MUJOCO_GL"] = "disabled"
try:
    from dm_control import mjcf
finally:
    del os.environ["MUJOCO_GL"]
    if _renderer is not None:
        os.environ["MUJOCO_GL"] = _renderer

__all__ = ["compiled", "mjcf"]


def compiled(root: mjcf.RootElement) -> mujoco.MjModel:
    """A fresh MuJoCo model of a PyMJCF tree.

    Raises:
        ValueError: MuJoCo cannot compile it.
    """
    return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
