"""Calibrate geometry, springs, zeros and masses of robots from recordings of a team that carries one payload."""
