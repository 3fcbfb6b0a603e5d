"""This folder decides what holds just after an event: transitions, resets, impacts, and who sticks or slips.

Start with `resolve`, which goes through one instant, then `choice` (joint decisions at surfaces).
"""
