"""Hidden effects: a blind generator, and how well the diagnosis finds what it hid."""
