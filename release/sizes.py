"""Table in Markdown of the packages of an installation: size of download, unpacked size, purpose.

    pip download --only-binary=:all: -d wheels . && python release/sizes.py wheels
"""

import re
import sys
from pathlib import Path
from zipfile import ZipFile

PURPOSE = {
    "mitsuba": "light: random paths, scenes",
    "drjit": "compiles Mitsuba's kernels",
    "karellen-llvm-core": "LLVM, which Mitsuba needs; of the system, on others than Linux on x86-64",
    "netgen-mesher": "meshes of pads",
    "netgen-occt": "OpenCASCADE: drawings for Netgen, STEP",
    "pytetwild": "meshes of STL files that Netgen cannot fill",
    "scipy": "sparse matrices, statistics, optimisation",
    "numpy": "arrays",
    "rslab": "factors the equations of the finite elements",
    "pandas": "tables; xarray",
    "xarray": "studies",
    "matplotlib": "plots",
    "contourpy, fonttools, kiwisolver, pillow, cycler, pyparsing": "matplotlib",
    "openexr": "irradiance maps",
    "trimesh": "surfaces of triangles",
    "meshio": "meshes for other programs",
    "rich, markdown-it-py, mdurl, pygments": "progress bars, tables in a terminal",
}
"""Purpose of each distribution; distributions that serve one purpose are in one row."""
EXTRA = {
    "netgen-mesher": "plates, fast models, pads without cells, STL files",
    "netgen-occt": "as Netgen",
    "pytetwild": "all but some STL files",
    "karellen-llvm-core": "where the system has LLVM 19 or newer",
}
"""What works without a part that can be left out (`pip uninstall`)."""


def main(folder: Path) -> None:
    wheels = {re.split("-", file.name)[0].lower().replace("_", "-"): file for file in folder.glob("*.whl")}
    rows, rest = [], dict(wheels)
    for names, purpose in PURPOSE.items():
        parts = [rest.pop(name) for name in names.split(", ") if name in rest]
        if parts:
            rows.append((*sizes(parts), names, purpose, EXTRA.get(names, "")))
    rows.append((*sizes(rest.values()), f"{len(rest)} others", "", ""))
    print("| package | download, MB | unpacked, MB | for | without it work |\n| :-- | --: | --: | :-- | :-- |")
    for download, unpacked, names, purpose, without in sorted(rows, reverse=True):
        print(f"| {names} | {download:.1f} | {unpacked:.0f} | {purpose} | {without} |")
    download, unpacked = sizes(wheels.values())
    print(f"| together ({len(wheels)} packages) | {download:.0f} | {unpacked:.0f} | | |")


def sizes(wheels) -> tuple[float, float]:
    """Total size in MB of wheels, and of their contents."""
    files = list(wheels)
    unpacked = sum(entry.file_size for file in files for entry in ZipFile(file).infolist())
    return sum(file.stat().st_size for file in files) / 1e6, unpacked / 1e6


if __name__ == "__main__":
    main(Path(sys.argv[1]))
