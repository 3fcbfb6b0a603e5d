"""This folder computes independent reference solutions in closed form and multiple precision, without the engine.

Start with `trajectory`, the data of an exact motion.
"""
