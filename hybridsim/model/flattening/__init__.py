"""This package writes the parts of a model into the model itself, so that all else sees one flat model.

Start with `flatten`.
"""
