"""Robots as they are: geometry, springs, zeros and masses from recordings of a team that carries one payload."""
