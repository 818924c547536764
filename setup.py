"""What pyproject.toml cannot say: the folder cases/ of the repository is the folder henon_ref/cases of a wheel."""

from setuptools import find_namespace_packages, setup

setup(
    packages=[
        *find_namespace_packages(include=["henon_ref*", "baselines*"], exclude=["*__pycache__"]),
        *(f"henon_ref.{folder}" for folder in find_namespace_packages(include=["cases*"])),
    ],
    package_dir={"henon_ref.cases": "cases"},
)
