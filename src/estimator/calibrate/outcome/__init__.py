"""What a calibration is good for: its numbers as people want them, as files and in the frames of drawings."""
