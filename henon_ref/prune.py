"""``python -m henon_ref.prune``: a door to :mod:`henon_ref.harness.cli.prune`, which nobody imports."""

if __name__ == "__main__":
    import sys

    from henon_ref.harness.cli.prune import command

    sys.exit(command())
elif __name__ != "__mp_main__":  # by which workers that are spawned import it
    raise ImportError("henon_ref.prune is no module to import but a command, python -m henon_ref.prune")
