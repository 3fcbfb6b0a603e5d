"""This package stores the results of a run: segments with dense output, events, counters, checkpoints.

Start with `segments` and `trajectory`. The files `*_block` store many segments or events in arrays.
"""
