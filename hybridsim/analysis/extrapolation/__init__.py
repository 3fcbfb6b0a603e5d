"""This package follows a motion from period to period and extrapolates its states to their limit.

Read `period_map`, then `settling`, `limit`, `growth` and `slight_slips`. `model_periods` is that of an ordinary model.
"""
