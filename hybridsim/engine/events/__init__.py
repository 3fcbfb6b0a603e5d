"""This package finds the state and modes just after an event: transitions, resets, impacts, stick, slip.

Start with `resolve`, which goes through one instant, then `choice` (joint decisions at surfaces).
"""
