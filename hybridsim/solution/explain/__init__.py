"""This package explains events: it repeats a decision and records all quantities that it used.

Start with `explanation`.
"""
