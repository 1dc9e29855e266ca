from .backend.own_plugins import load_plugins as load_plugins
from .base.errors import (
    ComputationError as ComputationError,
)
from .base.errors import (
    InputError as InputError,
)
from .check import check_scene as check_scene
from .electronics import (
    Circuit as Circuit,
)
from .electronics import (
    read_circuit as read_circuit,
)
from .mechanics import (
    ArrudaBoyce as ArrudaBoyce,
)
from .mechanics import (
    DeadForce as DeadForce,
)
from .mechanics import (
    Grooves as Grooves,
)
from .mechanics import (
    Indenter as Indenter,
)
from .mechanics import (
    IndenterDisplacement as IndenterDisplacement,
)
from .mechanics import (
    IndenterForce as IndenterForce,
)
from .mechanics import (
    IndenterShape as IndenterShape,
)
from .mechanics import (
    LayerSteps as LayerSteps,
)
from .mechanics import (
    Material as Material,
)
from .mechanics import (
    MooneyRivlin as MooneyRivlin,
)
from .mechanics import (
    Mullins as Mullins,
)
from .mechanics import (
    NeoHookean as NeoHookean,
)
from .mechanics import (
    Ogden as Ogden,
)
from .mechanics import (
    PatchForce as PatchForce,
)
from .mechanics import (
    PlateDisplacement as PlateDisplacement,
)
from .mechanics import (
    PlateForce as PlateForce,
)
from .mechanics import (
    PlateWrench as PlateWrench,
)
from .mechanics import (
    Pressure as Pressure,
)
from .mechanics import (
    RandomRoughness as RandomRoughness,
)
from .mechanics import (
    SeparateFinish as SeparateFinish,
)
from .mechanics import (
    SpreadForce as SpreadForce,
)
from .mechanics import (
    Viscoelastic as Viscoelastic,
)
from .mechanics import (
    Yeoh as Yeoh,
)
from .mechanics import (
    from_shore_a as from_shore_a,
)
from .mechanics import (
    linearise as linearise,
)
from .mechanics import (
    load_path as load_path,
)
from .mechanics import (
    silicone as silicone,
)
from .mechanics import (
    tessellate as tessellate,
)
from .pads import (
    Block as Block,
)
from .pads import (
    Pad as Pad,
)
from .pads import (
    PadFile as PadFile,
)
from .pads import (
    mesh_velocity as mesh_velocity,
)
from .report.notebook.views import show as show
from .sensing import (
    PadSensor as PadSensor,
)
from .sensing import (
    Readings as Readings,
)
from .sensing import (
    Scene as Scene,
)
from .sensing import (
    crosstalk as crosstalk,
)
from .sensing import (
    energy_audit as energy_audit,
)
from .sensing import (
    measure as measure,
)
from .sensing import (
    write_xml as write_xml,
)
from .specification.annular_led import AnnularLed as AnnularLed
from .specification.photo_reflector import PhotoReflector as PhotoReflector
from .specification.phototransistor import Phototransistor as Phototransistor
from .specification.wall import Wall as Wall
from .studies import (
    open_study as open_study,
)
from .studies import (
    run_study as run_study,
)
from .studies import (
    sweep as sweep,
)
from .studies import (
    training_set as training_set,
)
from .studies import (
    write_template as write_template,
)
