"""Faults that were mended, as small changes of the package that bring each of them back, and copies that have one."""
