"""This package stores the instruction tapes and the machine code for each combination of modes in a run.

Start with `mode_tables` (the tapes), then `mode_code` and `code_cache` (their machine code).
"""
