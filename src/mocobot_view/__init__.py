"""Replays and pictures of recordings, estimates and diagnoses."""
