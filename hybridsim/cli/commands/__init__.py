"""This folder holds the commands of the program, one module each, with options and action."""
