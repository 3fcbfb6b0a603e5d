"""This package computes derivatives of results of a run, such as extreme values and means."""
