"""Provenance: command, commit, machine and versions in the files equal those of the run."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

CODE = "from henon_ref.workers.machine import machine; print(machine()['linear_algebra'])"


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names kernels of this architecture")
@pytest.mark.parametrize("kernels", ["Haswell", "Nehalem"])
def test_the_kernels_of_linear_algebra_are_those_that_run(kernels: str) -> None:
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernels}
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True)
    if "openblas" not in done.stdout:
        pytest.skip(f"no OpenBLAS: {done.stdout.strip()}")
    packages = done.stdout.strip().removeprefix(f"openblas {kernels} (").removesuffix(")").split(", ")
    assert {"numpy", "scipy"} <= set(packages) <= {"numpy", "scipy", "scikit_sundae"}  # nobody runs on others
