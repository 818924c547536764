"""What pyproject.toml cannot say: the folder cases/ of the repository is the folder henon_ref/cases of a wheel, and the
libraries in C are built.
"""

from setuptools import find_namespace_packages, setup

from build_backend.commands import Build, BuildLibraries, PlatformDistribution, PlatformWheel

setup(
    packages=[
        *find_namespace_packages(include=["henon_ref*", "baselines*"], exclude=["*__pycache__"]),
        *(f"henon_ref.{folder}" for folder in find_namespace_packages(include=["cases*"])),
    ],
    package_dir={"henon_ref.cases": "cases"},
    distclass=PlatformDistribution,
    cmdclass={"build": Build, "build_libraries": BuildLibraries, "bdist_wheel": PlatformWheel},
)
