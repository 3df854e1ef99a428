"""What can be hidden, and how it is drawn."""
