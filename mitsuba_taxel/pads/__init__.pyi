from .imported.file_meshing import mesh_pad_file as mesh_pad_file
from .imported.rules import Rule as Rule
from .pad import (
    CELL_SHAPES as CELL_SHAPES,
)
from .pad import (
    REGIONS as REGIONS,
)
from .pad import (
    Pad as Pad,
)
from .pad_file import PadFile as PadFile
from .parametric.meshing import mesh_pad as mesh_pad
from .parametric.velocities import mesh_velocity as mesh_velocity
