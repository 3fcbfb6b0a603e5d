"""This folder decides what holds just after an event: transitions, resets, impacts, and stick or slip of contacts.

Start with `resolve`, which goes through one instant, then `choice` (joint decisions at surfaces).
"""
