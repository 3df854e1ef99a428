"""One Delta arm with its gimbal: geometry and inverse dynamics."""
