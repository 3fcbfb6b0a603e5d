"""This package runs a model from event to event: it integrates, locates, resolves and records.

Start with `mode_loop`, then `segment_run` (one segment) and `located` (the state at its end).
"""
