"""The packages of the tree, under the names by which they are imported; all else is in pyproject.toml."""

from setuptools import find_packages, setup

INSTALLED_AS = {
    "mitsuba_taxel": "mitsuba_taxel",
    "plugins": "mitsuba_taxel.plugins",
    "scenes": "mitsuba_taxel.scenes",
    "mitsuba_taxel/cli": "taxel_cli",  # loads without Mitsuba
}
# The links mitsuba_taxel/plugins and mitsuba_taxel/scenes are for a Python that is started in the tree itself.
ELSEWHERE = ["plugins*", "scenes*", "cli*"]

packages = [
    package
    for folder, name in INSTALLED_AS.items()
    for package in [name, *(f"{name}.{below}" for below in find_packages(folder, exclude=ELSEWHERE))]
]
setup(packages=packages, package_dir={name: folder for folder, name in INSTALLED_AS.items()})
