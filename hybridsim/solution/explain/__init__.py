"""This folder explains events: it repeats a decision and records every quantity that the decision used.

Start with `explanation`.
"""
