"""This folder runs a model from event to event: integrate a segment, locate its event, resolve it, record it.

Start with `mode_loop`, then `segment_run` (one segment) and `located` (the state at its end).
"""
