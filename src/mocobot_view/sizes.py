"""How large things without a size of their own are drawn."""

FORCE_M_PER_N = 0.006
"""Length of a force's arrow."""
FRAME_M = 0.10
"""Length of a frame's axes."""
MARK_M = 0.06
"""Radius of the ball that marks a cause."""
