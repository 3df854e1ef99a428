"""Whether a joint log's channels are what its map says, judged by the robot's model."""
