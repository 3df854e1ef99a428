"""Estimate a cooperatively held payload from joint encoders and SEA torques (numpy and scipy only)."""
