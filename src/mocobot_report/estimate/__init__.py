"""An estimate's part of a report."""
