"""What was hidden, closed until there is a verdict."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
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
        if not verdict or "found" not in verdict:
            raise ValueError("the truth stays sealed until there is a verdict")
        return dict(self._truth)

    def save(self, path: Path, request: Mapping[str, Any]) -> None:
        """Keep it in a file, with the request it belongs to."""
        temporary = path.with_suffix(".tmp")
        temporary.write_text(
            json.dumps({"request": request, "truth": self._truth}, indent=1), encoding="utf-8"
        )
        os.replace(temporary, path)

    @classmethod
    def load(cls, path: Path, request: Mapping[str, Any]) -> Sealed:
        """Read it again.

        Raises:
            ValueError: it belongs to another request.
        """
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["request"] != json.loads(json.dumps(request)):
            raise ValueError(f"{path} belongs to another request; delete its folder or choose another one")
        return cls(content["truth"])
