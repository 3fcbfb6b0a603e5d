"""This package computes Taylor coefficients along a flow from a tape of operations.

Start with `tape`, then `interpreter` (plain coefficients) and `bounded` (coefficients with error bounds). The
files `emit_*` run these kernels on values that write straight-line machine code (`trace`).
"""
