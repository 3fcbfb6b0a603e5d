"""Command line interface: one module per command. `main` runs one command line and reports its errors."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
