"""This package compiles the kernels, stores them in a disk cache, and passes arrays to them.

Only this folder and `system/user_functions` import numba or llvmlite. Read `kernels` first, then `compiler`,
`model_functions` and `cache`.
"""
