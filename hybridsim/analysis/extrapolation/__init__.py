"""This package follows a motion from period to period and extrapolates its states to their limit.

Read `period_map`, then `settling`, `limit` and `growth`. `model_periods` is the period map of an ordinary model.
"""
