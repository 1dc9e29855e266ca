from .material.material_fit import (
    MaterialFit as MaterialFit,
)
from .material.material_fit import (
    fit_material as fit_material,
)
from .material.written import (
    write_material as write_material,
)
from .run import (
    FitResult as FitResult,
)
from .run import (
    run_fit as run_fit,
)
