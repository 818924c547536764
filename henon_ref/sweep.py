"""``python -m henon_ref.sweep``: a door to :mod:`henon_ref.harness.cli.sweep`, which nobody imports."""

if __name__ == "__main__":
    import sys

    from henon_ref.harness.cli.sweep import program

    sys.exit(program())
elif __name__ != "__mp_main__":  # by which workers that are spawned import it
    raise ImportError(
        "henon_ref.sweep is no module to import but a command, python -m henon_ref.sweep; "
        "the function is there by: import henon_ref"
    )
