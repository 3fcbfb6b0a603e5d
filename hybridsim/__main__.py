"""`python -m hybridsim` runs the command line program `hybridsim`."""

from hybridsim.cli import command

if __name__ == "__main__":
    command()
