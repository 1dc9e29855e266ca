from .finding import Finding as Finding
from .scene import check_scene as check_scene
