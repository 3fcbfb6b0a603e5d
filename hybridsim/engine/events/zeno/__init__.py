"""This package detects accumulating (Zeno) events, and continues the motion from their limit.

Start with `accumulation`.
"""
