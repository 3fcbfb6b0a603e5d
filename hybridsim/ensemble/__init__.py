"""This folder runs one model for many parameters and starts at once, in compiled code.

Start with `runs`, then `run` and `start`.
"""
