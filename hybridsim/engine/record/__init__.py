"""This folder holds what a run leaves behind: segments with dense output, events, counters and checkpoints.

Start with `segments` and `trajectory`. The files `*_block` hold many segments or events in arrays.
"""
