"""A `System` is a model with parameter values: compiled functions, a run-time vector, and scheduled times.

Start with `system`, then `instant` (times as two doubles) and `timetable`.
"""
