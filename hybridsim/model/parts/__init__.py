"""This package defines the parts of a model: states, contacts, impacts, automata, events and inputs.

Start with `model`.
"""
