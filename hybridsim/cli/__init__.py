"""This package is the command line program. The function `main` in `entry` runs one of the `commands`."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
