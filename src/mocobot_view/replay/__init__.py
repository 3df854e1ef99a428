"""Replay: a recording as a moving scene and time series for the Rerun viewer (docs/replay.md)."""
