from .plan.steps import read_steps as read_steps
from .plan.templates import write_template as write_template
from .run.deformation import deform as deform
from .run.study import (
    Progress as Progress,
)
from .run.study import (
    run_study as run_study,
)
from .run.study import (
    sweep as sweep,
)
from .run.training import training_set as training_set
from .store.dataset import (
    stage_totals as stage_totals,
)
from .store.dataset import (
    study_error_budget as study_error_budget,
)
from .store.opening import open_study as open_study
