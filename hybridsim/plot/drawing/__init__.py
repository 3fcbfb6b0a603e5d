"""This package draws the mechanism of a model: `mechanism` at one time, and `animate` over a run."""
