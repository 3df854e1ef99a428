"""Impedance control over SEA torque loops."""
