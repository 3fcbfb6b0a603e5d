"""This package computes independent reference solutions without the engine.

Start with `trajectory`, the data of an exact motion.
"""
