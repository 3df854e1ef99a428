"""A serial robot with effects that its model lacked."""
