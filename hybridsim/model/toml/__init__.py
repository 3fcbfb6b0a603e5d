"""This folder reads models from TOML text, with the line of every fault, and writes them.

Start with `read`.
"""
