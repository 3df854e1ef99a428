"""The mocobot team as a rig of the diagnosis."""
