"""Offsets between the robots' clocks."""
