from .onnx_model import export as export
from .polynomial import (
    Polynomial as Polynomial,
)
from .polynomial import (
    polynomial_of as polynomial_of,
)
