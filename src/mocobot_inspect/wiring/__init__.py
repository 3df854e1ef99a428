"""Mistakes of wiring and mapping."""
