"""This package is the command line program: one module per command, and `main`, which runs a command line."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
