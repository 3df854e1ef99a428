"""Stamps and channels of one robot: rates, gaps, frozen sensors, resolution."""
