"""What is drawn: shapes and poses."""
