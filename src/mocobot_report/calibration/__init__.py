"""The part of a report on a calibration."""
