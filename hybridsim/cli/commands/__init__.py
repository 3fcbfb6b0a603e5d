"""This folder holds the commands of the program, one module each: its options, and what it does."""
