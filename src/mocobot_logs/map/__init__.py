"""Maps: which column is what."""
