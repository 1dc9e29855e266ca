from .characteristics import characteristics as characteristics
from .equations import (
    Deviation as Deviation,
)
from .equations import (
    hysteresis as hysteresis,
)
from .equations import (
    nonlinearity as nonlinearity,
)
from .equations import (
    repeatability as repeatability,
)
from .experiment import (
    Branch as Branch,
)
from .experiment import (
    Experiment as Experiment,
)
from .load_lines import experiments as experiments
from .ranking.comparison import (
    Comparison as Comparison,
)
from .ranking.comparison import (
    compare as compare,
)
from .ranking.ranking_rows import (
    comparison_rows as comparison_rows,
)
from .ranking.ranking_rows import (
    printed_comparison as printed_comparison,
)
from .ranking.ranking_rows import (
    ranking_notes as ranking_notes,
)
from .recorded.measurement import (
    Measurement as Measurement,
)
from .recorded.measurement import (
    read_measurement as read_measurement,
)
from .recorded.recorded_runs import recorded_experiment as recorded_experiment
from .resolution import resolution as resolution
from .sensitivity import (
    sensitivity as sensitivity,
)
from .sensitivity import (
    sensitivity_table as sensitivity_table,
)
from .simulated import (
    Simulated as Simulated,
)
from .simulated import (
    simulated_experiments as simulated_experiments,
)
from .slopes import (
    Slopes as Slopes,
)
from .slopes import (
    slopes as slopes,
)
from .summary import (
    common_channel as common_channel,
)
from .summary import (
    slope_summary as slope_summary,
)
from .tangential import (
    TangentialMap as TangentialMap,
)
from .tangential import (
    symmetric_pairs as symmetric_pairs,
)
from .tangential import (
    tangential_map as tangential_map,
)
from .tangential import (
    tangential_maps as tangential_maps,
)
from .volts import (
    volts_notes as volts_notes,
)
from .volts import (
    volts_table as volts_table,
)
