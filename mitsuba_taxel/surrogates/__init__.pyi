from .calibration import (
    Calibration as Calibration,
)
from .calibration import (
    calibrate as calibrate,
)
from .contact_export import export_contact as export_contact
from .contact_export import read_contact_model as read_contact_model
from .contact_export import write_contact_model as write_contact_model
from .contact_fit import contact_model as contact_model
from .contact_friction import FrictionPads as FrictionPads
from .contact_friction import FrictionReadings as FrictionReadings
from .contact_inputs import depth_maps as depth_maps
from .contact_inputs import force_maps as force_maps
from .contact_readings import ContactModel as ContactModel
from .contact_readings import ContactReadings as ContactReadings
from .imperfect import ImperfectPads as ImperfectPads
from .imperfect import ImperfectReadings as ImperfectReadings
from .imperfect import PadSpread as PadSpread
from .imperfect import read_spread as read_spread
from .memory import PadMemory as PadMemory
from .onnx_model import export as export
from .onnx_model import write_calibration as write_calibration
from .polynomial import (
    Polynomial as Polynomial,
)
from .polynomial import (
    polynomial_of as polynomial_of,
)
