"""``python -m henon_ref.check``: a door to :mod:`henon_ref.cli.check`, which nobody imports."""

import sys

from henon_ref.cli.check import command

if __name__ == "__main__":
    sys.exit(command())
