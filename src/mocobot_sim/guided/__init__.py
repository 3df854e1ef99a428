"""A person guides the payload by hand, and the robots carry its weight."""
