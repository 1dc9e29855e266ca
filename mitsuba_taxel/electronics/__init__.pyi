from .circuit import (
    Circuit as Circuit,
)
from .circuit import (
    read_circuit as read_circuit,
)
from .noise import (
    noise_parts as noise_parts,
)
from .noise import (
    total_noise as total_noise,
)
from .response import (
    Response as Response,
)
from .response import (
    power_at as power_at,
)
from .response import (
    respond as respond,
)
from .saturation import (
    change_to_saturation as change_to_saturation,
)
from .saturation import (
    saturated_words as saturated_words,
)
from .saturation import (
    saturating_power as saturating_power,
)
from .saturation import (
    saturation_force as saturation_force,
)
from .shown import (
    Shown as Shown,
)
from .shown import (
    ShownDerivatives as ShownDerivatives,
)
from .shown import (
    shown as shown,
)
from .volts import (
    in_volts as in_volts,
)
from .volts import (
    with_volts as with_volts,
)
