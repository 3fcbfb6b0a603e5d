"""This folder recognises events that accumulate, and finds the motion that goes on in their limit.

Start with `accumulation`.
"""
