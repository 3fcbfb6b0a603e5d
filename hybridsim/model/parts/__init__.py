"""One declares these parts: states, contacts, impacts, automata, monitors, schedules, inputs, and the model of them.

Start with `model`.
"""
