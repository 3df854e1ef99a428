"""Pictures of a diagnosis."""
