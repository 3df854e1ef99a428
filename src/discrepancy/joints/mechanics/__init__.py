"""Mechanics of a tree of hinges and slides, all samples of a log at once."""
