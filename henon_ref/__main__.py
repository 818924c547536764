"""``python -m henon_ref``: a door to :mod:`henon_ref.harness.cli.main`, which nobody imports."""

import sys

from henon_ref.harness.cli.main import program

if __name__ == "__main__":
    sys.exit(program())
