"""The team in MJCF."""
