"""The paper's part of a report."""
