from .card import (
    card_curve as card_curve,
)
from .card import (
    distance_model as distance_model,
)
from .mirror import (
    MirrorRays as MirrorRays,
)
from .mirror import (
    edge_positions as edge_positions,
)
from .mirror import (
    leaving_share as leaving_share,
)
from .mirror import (
    mirror_curve as mirror_curve,
)
from .mirror import (
    mirror_rays as mirror_rays,
)
from .part import (
    Datasheet as Datasheet,
)
from .part import (
    Part as Part,
)
from .part import (
    Side as Side,
)
from .part import (
    part_names as part_names,
)
from .part import (
    read_datasheet as read_datasheet,
)
from .part import (
    read_part as read_part,
)
from .part_circuit import circuit_of_part as circuit_of_part
