"""This folder detects events that accumulate, and finds the motion that continues from their limit.

Start with `accumulation`.
"""
