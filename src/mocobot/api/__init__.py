"""What ``mocobot`` offers to Python; take it from there (docs/api.md)."""
