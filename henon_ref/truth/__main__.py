"""``python -m henon_ref.truth CASE...``"""

from henon_ref.truth.command import app

if __name__ == "__main__":
    app(prog_name="python -m henon_ref.truth")
