from .run import (
    FitResult as FitResult,
)
from .run import (
    run_fit as run_fit,
)
