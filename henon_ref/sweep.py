"""``python -m henon_ref.sweep``: a door to :mod:`henon_ref.cli.sweep`, which nobody imports."""

import sys

from henon_ref.cli.sweep import program

if __name__ == "__main__":
    sys.exit(program())
