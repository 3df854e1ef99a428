"""Diagnosis of one robot of revolute and prismatic joints: signals, causes and regressor columns."""
