"""What was hidden, closed until there is a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Sealed:
    """The truth about one data set; it opens only against a verdict."""

    def __init__(self, truth: Mapping[str, Any]) -> None:
        """Seal it."""
        self._truth = dict(truth)

    def open(self, verdict: Mapping[str, Any] | None) -> dict[str, Any]:
        """The truth: ``payload``, ``effects`` and ``background``, ``gimbal_axes_1`` at home, shape (N, 3, 3).

        Raises:
            ValueError: there is no verdict yet.
        """
        if verdict is None:
            raise ValueError("the truth stays sealed until there is a verdict")
        return dict(self._truth)
