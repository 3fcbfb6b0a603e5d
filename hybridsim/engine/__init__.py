"""The engine: from a declared automaton to compiled functions, events and the mode loop."""
