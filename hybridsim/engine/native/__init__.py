"""This folder compiles kernels, keeps them on disk, and gives them their arrays.

This is the only folder beside `system/user_functions` that imports numba or llvmlite. Start with `kernels`, then
`cache`.
"""
