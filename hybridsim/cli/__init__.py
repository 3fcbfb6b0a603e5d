"""This package is the command line program: start with `entry`, whose function `main` runs one of `commands`."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
