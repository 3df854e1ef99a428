"""Damage to real logs, and what the readers make of it."""
