"""``python -m henon_ref.truth CASE...``"""

import sys

from henon_ref.cli.truth import command

if __name__ == "__main__":
    sys.exit(command())
