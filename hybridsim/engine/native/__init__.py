"""This folder compiles the kernels, caches them on disk and passes arrays to them.

Only this folder and `system/user_functions` import numba or llvmlite. Read `kernels` first, then
`cache`.
"""
