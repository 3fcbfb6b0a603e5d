"""This package reads models from TOML text, reports the line of every fault, and writes models.

Start with `read`.
"""
