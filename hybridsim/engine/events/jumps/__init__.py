"""This package computes the jumps of the states at an event, by impacts and by resets."""
