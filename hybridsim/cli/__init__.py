"""This package is the command line program: one module per command, and the function `main`."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
