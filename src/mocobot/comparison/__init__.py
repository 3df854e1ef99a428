"""Two results side by side: what differs by more than its errors."""
