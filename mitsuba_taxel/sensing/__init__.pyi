from .audit import (
    EnergyAudit as EnergyAudit,
)
from .audit import (
    energy_audit as energy_audit,
)
from .measurement import (
    crosstalk as crosstalk,
)
from .measurement import (
    measure as measure,
)
from .pad_sensor import PadSensor as PadSensor
from .ray_paths import (
    RayPaths as RayPaths,
)
from .ray_paths import (
    sample_paths as sample_paths,
)
from .readings import (
    Crosstalk as Crosstalk,
)
from .readings import (
    Readings as Readings,
)
from .scene import (
    Scene as Scene,
)
from .scene import (
    find_scene as find_scene,
)
from .scene import (
    write_xml as write_xml,
)
