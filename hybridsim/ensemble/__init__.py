"""This package runs one model for many parameter values and starts together, in compiled code.

Start with `runs`, then `run` and `start`.
"""
