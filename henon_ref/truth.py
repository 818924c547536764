"""``python -m henon_ref.truth``: a door to :mod:`henon_ref.harness.cli.truth`, which nobody imports."""

if __name__ == "__main__":
    import sys

    from henon_ref.harness.cli.truth import command

    sys.exit(command())
elif __name__ != "__mp_main__":  # by which workers that are spawned import it
    raise ImportError("henon_ref.truth is no module to import but a command, python -m henon_ref.truth")
