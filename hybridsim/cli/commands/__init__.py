"""This package contains the commands of the program: one module for each command."""
