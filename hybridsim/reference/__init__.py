"""This folder computes independent truths, in closed form and multiple precision, without code of the engine.

Start with `trajectory`, what an exact motion consists of.
"""
