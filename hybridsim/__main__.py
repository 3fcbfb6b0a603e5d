"""`python -m hybridsim` is the command `hybridsim`."""

import sys

from hybridsim.cli import main

if __name__ == "__main__":
    sys.exit(main())
