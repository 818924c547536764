"""``python -m henon_ref.compare``: a door to :mod:`henon_ref.cli.compare`, which nobody imports."""

import sys

from henon_ref.cli.compare import program

if __name__ == "__main__":
    sys.exit(program())
