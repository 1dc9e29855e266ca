from .result import (
    Optimum as Optimum,
)
from .run import (
    optimise as optimise,
)
