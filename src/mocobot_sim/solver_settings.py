"""Settings of MuJoCo's constraint rows that several parts of a scene share."""

from typing import Any

STIFF: dict[str, Any] = {"solref": [0.004, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0]}
"""What holds as a rigid part would: welds, and limits that nothing goes through."""
