"""This package resolves ordinary events in compiled code, by the same rules as `resolve`.

Start with `after_segment`, then `resolve_ordinary`.
"""
