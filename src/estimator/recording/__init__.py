"""Recordings: data model, metadata, checks, files."""
