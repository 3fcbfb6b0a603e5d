"""The command line: one file a command; `main` runs one line and answers for its errors."""

from hybridsim.cli.entry import command as command
from hybridsim.cli.entry import main as main
