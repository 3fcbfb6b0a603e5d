"""This package converts a model with parts to one flat model, which all other packages use.

Start with `flatten`.
"""
