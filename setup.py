"""Maps folders of the source tree to the names of packages; all other settings are in pyproject.toml."""

import os
import re
from pathlib import Path

from setuptools import find_packages, setup

INSTALLED_AS = {
    "mitsuba_taxel": "mitsuba_taxel",
    "plugins": "mitsuba_taxel.plugins",
    "scenes": "mitsuba_taxel.scenes",
    "mitsuba_taxel/cli": "taxel_cli",  # loads without Mitsuba
}
# The links mitsuba_taxel/plugins and mitsuba_taxel/scenes are for a Python that is started in the tree itself.
ELSEWHERE = ["plugins*", "scenes*", "cli*"]
HOME = os.environ.get("PROJECT_URL", "").rstrip("/")  # where the source is hosted, as the workflow that publishes says


def description() -> str:
    """The README, with links to files of the source tree replaced by links to its host."""
    text = Path("README.md").read_text(encoding="utf-8")
    if not HOME:
        return text
    text = re.sub(r"!\[([^]]*)\]\((?!https?:)", rf"![\1]({HOME}/raw/HEAD/", text)
    return re.sub(r"(?<!!)\[([^]]*)\]\((?!https?:|#)", rf"[\1]({HOME}/blob/HEAD/", text)


packages = [
    package
    for folder, name in INSTALLED_AS.items()
    for package in [name, *(f"{name}.{below}" for below in find_packages(folder, exclude=ELSEWHERE))]
]
setup(
    packages=packages,
    package_dir={name: folder for folder, name in INSTALLED_AS.items()},
    long_description=description(),
    long_description_content_type="text/markdown",
    project_urls={
        "Source": HOME, "Documentation": f"{HOME}/blob/HEAD/docs/index.md", "Issues": f"{HOME}/issues",
        "Changelog": f"{HOME}/blob/HEAD/CHANGELOG.md",
    } if HOME else {},
)  # fmt: skip
