"""``python -m henon_ref.price``: a door to :mod:`henon_ref.cli.price`, which nobody imports."""

import sys

from henon_ref.cli.price import command

if __name__ == "__main__":
    sys.exit(command())
