"""Scenes of a team in MJCF."""
