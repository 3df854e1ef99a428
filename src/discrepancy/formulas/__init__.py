"""Formulas for unlisted laws: functions of one signal."""
