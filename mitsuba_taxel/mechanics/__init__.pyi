from .contact.barriers.self_contact import (
    Contact as Contact,
)
from .contact.barriers.self_contact import (
    ContactTest as ContactTest,
)
from .contact.indenter import Indenter as Indenter
from .contact.indenter_shape import Gap as Gap
from .contact.indenter_shape import IndenterShape as IndenterShape
from .continuation.state import RoofError as RoofError
from .continuation.state import State as State
from .continuation.state import ViscoelasticMemory as ViscoelasticMemory
from .derivatives.linearised_state import (
    LinearisedState as LinearisedState,
)
from .derivatives.rates_along import rates_along as rates_along
from .derivatives.sensitivities import (
    linearise as linearise,
)
from .elements.loads import (
    DeadForce as DeadForce,
)
from .elements.loads import (
    IndenterDisplacement as IndenterDisplacement,
)
from .elements.loads import (
    IndenterForce as IndenterForce,
)
from .elements.loads import (
    Load as Load,
)
from .elements.loads import (
    PatchForce as PatchForce,
)
from .elements.loads import (
    PlateDisplacement as PlateDisplacement,
)
from .elements.loads import (
    PlateForce as PlateForce,
)
from .elements.loads import (
    PlateWrench as PlateWrench,
)
from .elements.loads import (
    Pressure as Pressure,
)
from .elements.loads import (
    SpreadForce as SpreadForce,
)
from .elements.solvers import available_solvers as available_solvers
from .errors.mesh_sizes import chosen_size as chosen_size
from .errors.mesh_sizes import mesh_size_for as mesh_size_for
from .errors.second_state import second_state as second_state
from .load_paths import load_path as load_path
from .load_paths import state_after as state_after
from .load_paths import state_at_rest as state_at_rest
from .locate import (
    displacement_at as displacement_at,
)
from .locate import (
    displacement_gradient_at as displacement_gradient_at,
)
from .materials.laws import (
    ArrudaBoyce as ArrudaBoyce,
)
from .materials.laws import (
    Material as Material,
)
from .materials.laws import (
    MooneyRivlin as MooneyRivlin,
)
from .materials.laws import (
    NeoHookean as NeoHookean,
)
from .materials.laws import (
    Ogden as Ogden,
)
from .materials.laws import (
    Yeoh as Yeoh,
)
from .materials.mullins import (
    Mullins as Mullins,
)
from .materials.silicones import (
    SILICONES as SILICONES,
)
from .materials.silicones import (
    Silicone as Silicone,
)
from .materials.silicones import (
    from_shore_a as from_shore_a,
)
from .materials.silicones import (
    silicone as silicone,
)
from .materials.viscoelastic import (
    Viscoelastic as Viscoelastic,
)
from .results.balance import (
    Reactions as Reactions,
)
from .results.balance import (
    reactions as reactions,
)
from .results.contact_pressure import contact_pressure as contact_pressure
from .results.fields import (
    NodalFields as NodalFields,
)
from .results.fields import (
    nodal_fields as nodal_fields,
)
from .results.vtu import write_vtu as write_vtu
from .surface.bending import (
    bent_normals as bent_normals,
)
from .surface.bending import (
    curvature_errors as curvature_errors,
)
from .surface.finish import (
    Finish as Finish,
)
from .surface.finish import (
    Grooves as Grooves,
)
from .surface.finish import (
    LayerSteps as LayerSteps,
)
from .surface.finish import (
    RandomRoughness as RandomRoughness,
)
from .surface.surface_rates import (
    surface_gradient as surface_gradient,
)
from .surface.surface_rates import (
    surface_rates as surface_rates,
)
from .surface.tessellation import (
    Surface as Surface,
)
from .surface.tessellation import (
    contact_pressure_at_vertices as contact_pressure_at_vertices,
)
from .surface.tessellation import (
    tessellate as tessellate,
)
from .surface.wall_finishes import (
    SeparateFinish as SeparateFinish,
)
from .surface.wall_finishes import (
    check_finish as check_finish,
)
