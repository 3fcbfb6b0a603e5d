"""This package binds a model to parameter values: compiled functions, run-time vector, schedules.

Start with `system`, then `instant` (times as two doubles) and `timetable`.
"""
