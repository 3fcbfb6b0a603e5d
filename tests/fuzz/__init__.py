"""Inputs that are wrong on purpose, and what the program makes of them."""
