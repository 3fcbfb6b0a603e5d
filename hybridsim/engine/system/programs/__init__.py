"""This folder stores the tapes and the machine code for each combination of modes that a run meets.

Start with `mode_tables` (the tapes), then `mode_code` and `code_cache` (their machine code).
"""
