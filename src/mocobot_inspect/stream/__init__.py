"""Stamps and channels."""
