"""Rows, unknowns and their fit."""
