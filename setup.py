"""What pyproject.toml cannot say: the folders baselines/ and cases/ of the repository are henon_ref/baselines and
henon_ref/cases of a wheel, and the libraries in C are built.
"""

from setuptools import find_namespace_packages, setup

from build_backend.commands import Build, BuildLibraries, PlatformDistribution, PlatformWheel
from build_backend.libraries import INSIDE

CACHES = "*__pycache__"
MOVED = find_namespace_packages(include=[f"{folder}*" for folder in INSIDE], exclude=[CACHES])

setup(
    packages=[
        *find_namespace_packages(include=["henon_ref*"], exclude=[CACHES, "henon_ref.baselines"]),
        *(f"henon_ref.{package}" for package in MOVED),
    ],
    package_dir={f"henon_ref.{folder}": folder for folder in INSIDE},
    exclude_package_data={"henon_ref": ["baselines/*"]},  # the door of a checkout, which an sdist has, too
    distclass=PlatformDistribution,
    cmdclass={"build": Build, "build_libraries": BuildLibraries, "bdist_wheel": PlatformWheel},
)
