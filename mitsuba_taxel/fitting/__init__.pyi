from .material.material_fit import (
    MaterialFit as MaterialFit,
)
from .material.material_fit import (
    fit_material as fit_material,
)
from .material.written import (
    write_material as write_material,
)
from .part.part_fit import (
    PartFit as PartFit,
)
from .part.part_fit import (
    fit_part as fit_part,
)
from .part.written import (
    write_part as write_part,
)
from .run import (
    FitResult as FitResult,
)
from .run import (
    run_fit as run_fit,
)
