"""Onto one even grid."""
