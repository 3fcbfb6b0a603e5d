"""This package finds the steady motions of mechanical systems given as arrays.

Read `steady_state`, then `period_map` and `result`.
"""
