"""This folder computes how states jump at an event: impulses of impacts, and resets."""
