"""This folder decides which combination of modes contacts and switching surfaces take just after an event.

Start with `verdict`, the rules as pure functions of arrays.
"""
