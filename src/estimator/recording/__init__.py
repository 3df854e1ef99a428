"""Recordings: model, metadata, checks, files."""
