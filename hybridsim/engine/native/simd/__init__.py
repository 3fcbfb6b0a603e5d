"""This folder computes with vectors of several numbers at once; start with `vectors`."""
