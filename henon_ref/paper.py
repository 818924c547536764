"""``python -m henon_ref.paper``: a door to :mod:`henon_ref.cli.paper`, which nobody imports."""

import sys

from henon_ref.cli.paper import command

if __name__ == "__main__":
    sys.exit(command())
