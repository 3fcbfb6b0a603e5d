"""This package runs one model for many parameter values and starts together, in compiled code.

Start with `group`. `runs` and `run` follow runs to their last periods, `orbits` and `search` find steady motions.
"""
