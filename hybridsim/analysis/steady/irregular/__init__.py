"""This package follows motions that do not repeat, and measures how fast small changes of them grow."""
