"""This folder carries a run from event to event: follow a segment, locate its event, resolve it, record it.

Start with `mode_loop`, then `segment_run` (one segment) and `located` (what is known at its end).
"""
