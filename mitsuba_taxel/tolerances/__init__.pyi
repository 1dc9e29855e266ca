from .analysis import (
    Tolerance as Tolerance,
)
from .laws import (
    Law as Law,
)
from .laws import (
    law_of as law_of,
)
from .run import (
    run_tolerance as run_tolerance,
)
