"""This package chooses the modes of contacts and switching surfaces just after an event.

Start with `verdict` (one combination) and `joint_choice` (several), the rules as pure functions that the general loop
and compiled loops call; then `event_verdicts` and `cluster_choice`, which call them in the general loop.
"""
