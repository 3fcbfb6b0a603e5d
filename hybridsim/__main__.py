"""`python -m hybridsim` is the command `hybridsim`."""

from hybridsim.cli import command

if __name__ == "__main__":
    command()
