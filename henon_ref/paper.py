"""``python -m henon_ref.paper``: a door to :mod:`henon_ref.harness.cli.paper`, which nobody imports."""

if __name__ == "__main__":
    import sys

    from henon_ref.harness.cli.paper import command

    sys.exit(command())
elif __name__ != "__mp_main__":  # by which workers that are spawned import it
    raise ImportError("henon_ref.paper is no module to import but a command, python -m henon_ref.paper")
