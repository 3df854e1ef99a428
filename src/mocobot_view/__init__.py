"""Replay and pictures."""
