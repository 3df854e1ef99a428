"""Mistakes of wiring and mapping: what fits together physically, and which mistake undone makes it fit."""
