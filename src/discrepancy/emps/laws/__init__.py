"""Laws at the axis."""
