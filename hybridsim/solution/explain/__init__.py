"""This folder explains an event: it makes the decision once more and keeps everything that it looked at.

Start with `explanation`.
"""
