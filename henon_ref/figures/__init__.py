"""Figures: functions that draw curves on given axes."""
