from .imported.rules import Rule as Rule
from .pad_file import PadFile as PadFile
from .pad_file import mesh_pad_file as mesh_pad_file
from .parametric.meshing import mesh_pad as mesh_pad
from .parametric.pad import CELL_SHAPES as CELL_SHAPES
from .parametric.pad import Pad as Pad
from .parametric.velocities import mesh_velocity as mesh_velocity
from .regions import REGIONS as REGIONS
