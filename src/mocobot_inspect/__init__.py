"""Inspect a log before use: its contents, its faults, and what it is ready for."""
