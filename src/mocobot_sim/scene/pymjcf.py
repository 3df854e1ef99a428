"""Lazy import of PyMJCF (``dm_control.mjcf``), without a renderer.

At import, dm_control loads a renderer, which warns or fails without a display; composing scenes needs none. The lazy
import lets all other functions work without dm_control.
"""

import os
from typing import TYPE_CHECKING, Any

import mujoco

from estimator.errors import InputError

__all__ = ["compiled", "mjcf", "why_not_composed"]


class _PyMjcf:
    """Proxy that imports the module at the first attribute access."""

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
    """Reason why scenes cannot be composed, such as a missing dm_control; None if they can."""
    try:
        return mjcf.RootElement and None
    except InputError as error:
        return str(error)


def compiled(root: "mjcf.RootElement") -> mujoco.MjModel:
    """Compile a PyMJCF tree to a new MuJoCo model.

    Raises:
        ValueError: MuJoCo cannot compile the tree.
    """
    return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
