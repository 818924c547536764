"""``python -m henon_ref.prune``: a door to :mod:`henon_ref.cli.prune`, which nobody imports."""

import sys

from henon_ref.cli.prune import command

if __name__ == "__main__":
    sys.exit(command())
