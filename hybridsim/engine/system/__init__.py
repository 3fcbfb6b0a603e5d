"""A `System` is a model with numbers: compiled functions, a run-time vector, and the times at which something is due.

Start with `system`, then `instant` (times as two doubles) and `timetable`.
"""
