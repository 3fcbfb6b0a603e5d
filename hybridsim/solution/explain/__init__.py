"""This folder explains an event: it repeats the decision and records every quantity that was used.

Start with `explanation`.
"""
