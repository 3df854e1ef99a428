"""The part of the page on a blind campaign."""
