"""This folder settles ordinary events in compiled code, by the same rules.

Start with `after_segment`, then `resolve_ordinary`.
"""
