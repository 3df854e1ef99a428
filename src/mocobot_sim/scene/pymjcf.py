"""PyMJCF (``dm_control.mjcf``), imported when a scene is first composed, and without a renderer.

dm_control loads a renderer when it is imported, and warns or fails without a display; composing needs none. What
composes nothing works where it is not installed.
"""

import os
from typing import TYPE_CHECKING, Any

import mujoco

from estimator.errors import InputError

__all__ = ["compiled", "mjcf", "why_not_composed"]


class _PyMjcf:
    """The module, imported when something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        renderer = os.environ.get("MUJOCO_GL")
        os.environ["MUJOCO_GL"] = "disabled"
        try:
            from dm_control import mjcf
        except ImportError as error:
            raise InputError(
                f"a team's scene cannot be composed without dm-control ({error}); "
                "get it with: pip install --no-deps dm-control"
            ) from error
        finally:
            del os.environ["MUJOCO_GL"]
            if renderer is not None:
                os.environ["MUJOCO_GL"] = renderer
        return self.__dict__.setdefault(name, getattr(mjcf, name))


if TYPE_CHECKING:
    from dm_control import mjcf
else:
    mjcf = _PyMjcf()


def why_not_composed() -> str | None:
    """Why no scene can be composed, or None."""
    try:
        return mjcf.RootElement and None
    except InputError as error:
        return str(error)


def compiled(root: "mjcf.RootElement") -> mujoco.MjModel:
    """A fresh MuJoCo model of a PyMJCF tree.

    Raises:
        ValueError: MuJoCo cannot compile it.
    """
    return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
