"""The benchmark's recordings."""
