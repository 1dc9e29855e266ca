"""The silicone pad: shapes of its cells, its dimensions, pads from files, and volume meshes with tagged regions.

Input: dimensions of cells and pad in mm, or a file. Output: drawings, volume meshes whose faces have a region and a
cell, and the velocities of nodes with respect to dimensions.
"""

import lazy_loader

# A scene that only names a pad's regions needs no mesh.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
