"""Commented templates of scenes, studies, tables of steps, circuits and parts."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.atomic import write_text
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.studies.plan.files import check_new_file

SUFFIXES = {"scene": ".xml", "touch": ".xml", "study": ".toml", "steps": ".csv", "circuit": ".toml", "part": ".toml"}

_SCENE = """\
<!-- A silicone pad of hollow cells on photo-reflectors, under a force. Lengths in mm, forces in N, powers in W.
     taxel render scene.xml                  what each phototransistor reads
     taxel render scene.xml -D fz=-10        the same with another value of a default
     taxel plugins deformable_pad            all parameters of a pad; likewise for every other type -->
<scene version="3.9.0">
    <!-- Load: total force on the top of the pad, in N; compression is fz below 0. -->
    <default name="fx" value="0"/>
    <default name="fy" value="0"/>
    <default name="fz" value="-5"/>

    <!-- Pad, in mm. The height of a cell follows from its shape; to set it, add cell_height to the pad below. -->
    <default name="cell" value="parallelepiped"/>        <!-- parallelepiped, cylindrical, spherical, hemispheric -->
    <default name="rows" value="3"/>                     <!-- of cells and photo-reflectors, along y -->
    <default name="columns" value="3"/>                  <!-- along x -->
    <default name="pitch" value="3.55"/>                 <!-- between centres of neighbouring cells -->
    <default name="wall" value="1"/>                     <!-- silicone around the outermost cells -->
    <default name="height" value="4.55"/>                <!-- from the board to the loaded top -->
    <default name="cell_size" value="2.55"/>             <!-- side or diameter of a cell -->

    <!-- Silicone: neo-Hookean. Other models and measured silicones: taxel plugins deformable_pad. -->
    <default name="youngs_modulus" value="4.16"/>        <!-- MPa, above 0 -->
    <default name="poisson_ratio" value="0.49"/>         <!-- 0 to 0.5; 0.5 is incompressible -->

    <!-- Walls of the cells. -->
    <default name="roof" value="isotropic"/>             <!-- mirror, lambertian, isotropic -->
    <default name="roof_reflectance" value="1"/>         <!-- 0 to 1 -->
    <default name="side" value="absorbing"/>             <!-- mirror, lambertian, isotropic, absorbing -->

    <!-- LED, a square. -->
    <default name="led_power" value="1"/>                <!-- W, of each LED -->
    <default name="wavelength" value="925"/>             <!-- nm -->
    <default name="led_size" value="0.25"/>              <!-- mm -->
    <default name="hole" value="0.1"/>                   <!-- mm, dark centre; 0 for none -->
    <default name="law" value="uniform_solid_angle"/>    <!-- uniform_solid_angle, uniform_polar_angle, lambertian -->

    <!-- Phototransistor, a rectangle. -->
    <default name="spacing" value="0.9"/>                <!-- mm, between its centre and that of the LED, along x -->
    <default name="width" value="0.52"/>                 <!-- mm, along x -->
    <default name="depth" value="0.3"/>                  <!-- mm, along y -->
    <default name="quantum_efficiency" value="1"/>       <!-- electrons per photon, above 0, at most 1 -->

    <!-- Assembly: misalignment of the board, with all packages, to the pad. -->
    <default name="dx" value="0"/>                       <!-- mm, of packages from their cells' centres, towards +x -->
    <default name="dy" value="0"/>                       <!-- mm, towards +y -->
    <default name="gap" value="0"/>                      <!-- mm, from board to pad, such as glue; 0 or more -->
    <default name="tilt" value="0"/>                     <!-- degrees, of all packages about the x axis -->
    <default name="turn" value="0"/>                     <!-- degrees, of the board about the z axis -->
    <default name="board" value="absorbing"/>            <!-- mirror, lambertian, isotropic, absorbing -->

    <integrator type="taxel_tracer"/>

    <shape type="deformable_pad">
        <string name="cell" value="$cell"/>
        <integer name="rows" value="$rows"/>
        <integer name="columns" value="$columns"/>
        <float name="pitch" value="$pitch"/>
        <float name="wall" value="$wall"/>
        <float name="height" value="$height"/>
        <float name="cell_size" value="$cell_size"/>
        <float name="youngs_modulus" value="$youngs_modulus"/>
        <float name="poisson_ratio" value="$poisson_ratio"/>
        <!-- With a target error, finite elements are chosen by it, unless their size is given here:
             <float name="mesh_size" value="1.25"/> in mm -->
        <vector name="force" value="$fx, $fy, $fz"/>
        <bsdf type="region">                             <!-- regions not named here absorb -->
            <bsdf name="roof" type="wall">
                <string name="scattering" value="$roof"/>
                <float name="reflectance" value="$roof_reflectance"/>
            </bsdf>
            <bsdf name="side" type="wall">
                <string name="scattering" value="$side"/>
            </bsdf>
        </bsdf>
    </shape>

    <!-- One under each cell. Taxels are numbered from 1 at (-x, +y), row by row towards -y. -->
    <shape type="photo_reflector">
        <integer name="rows" value="$rows"/>
        <integer name="columns" value="$columns"/>
        <float name="pitch" value="$pitch"/>
        <float name="spacing" value="$spacing"/>
        <transform name="to_world">
            <rotate x="1" angle="$tilt"/>
            <rotate z="1" angle="$turn"/>
            <translate x="$dx" y="$dy" z="-$gap"/>
        </transform>
        <emitter type="annular_led">
            <float name="power" value="$led_power"/>
            <float name="wavelength" value="$wavelength"/>
            <float name="size" value="$led_size"/>
            <float name="hole" value="$hole"/>
            <string name="law" value="$law"/>
        </emitter>
        <sensor type="phototransistor">
            <float name="width" value="$width"/>
            <float name="depth" value="$depth"/>
            <float name="quantum_efficiency" value="$quantum_efficiency"/>
        </sensor>
    </shape>

    <!-- The board, under the packages. -->
    <shape type="rectangle">
        <transform name="to_world"><scale value="100"/><translate z="-$gap"/></transform>
        <bsdf type="wall"> <string name="scattering" value="$board"/> </bsdf>
    </shape>
</scene>
"""


def _exchanged(text: str, *pairs: tuple[str, str]) -> str:
    """A text in which each first of some pairs, which it holds, is the second."""
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


_TOUCH = _exchanged(
    _SCENE,
    (
        """on photo-reflectors, under a force. Lengths in mm, forces in N, powers in W.
     taxel render scene.xml                  what each phototransistor reads
     taxel render scene.xml -D fz=-10        the same with another value of a default
""",
        """on photo-reflectors, pressed by a ball. Lengths in mm, forces in N, powers in W.
     taxel render touch.xml                          what each phototransistor reads
     taxel render touch.xml -D indenter=punch        the same with another value of a default
     taxel picture touch.xml                         pad, ball and what it presses with
     For a map of readings, let taxel sweep vary indenter_x and indenter_y.
""",
    ),
    (
        """    <!-- Load: total force on the top of the pad, in N; compression is fz below 0. -->
    <default name="fx" value="0"/>
    <default name="fy" value="0"/>
    <default name="fz" value="-5"/>
""",
        """    <!-- Load: a rigid body, pushed down from where it just touches the top. -->
    <default name="indenter" value="sphere"/>            <!-- sphere, punch, cylinder -->
    <default name="indenter_radius" value="2.5"/>        <!-- mm -->
    <default name="indenter_x" value="0"/>               <!-- mm, from the centre of the pad -->
    <default name="indenter_y" value="0"/>               <!-- mm -->
    <default name="indenter_depth" value="0.5"/>         <!-- mm -->
""",
    ),
    (
        """        <vector name="force" value="$fx, $fy, $fz"/>
""",
        """        <!-- Or by force, in N: load "indenter_force" and <vector name="force" value="0, 0, -2"/> -->
        <string name="load" value="indenter_displacement"/>
        <vector name="displacement" value="0, 0, -$indenter_depth"/>
        <string name="indenter" value="$indenter"/>
        <float name="indenter_radius" value="$indenter_radius"/>
        <float name="indenter_x" value="$indenter_x"/>
        <float name="indenter_y" value="$indenter_y"/>
""",
    ),
)

_STUDY = """\
# taxel sweep study.toml -o runs/study

target_error = 0.005      # relative, of light and mechanics, for the worst taxel; alternatively: points = 4096
seed = 0                  # 0 to 2**32 - 1

# Any number of scenes. For a single one, leave out [[scenes]] and name, and write scene, [define], [vary] and
# [together] instead of scene, [scenes.define], [scenes.vary] and [scenes.together].

[[scenes]]
name = "normal"           # label and folder of its results: letters, digits and _
scene = "pad.xml"         # a shipped scene, or a path relative to this file

[scenes.define]           # values of the scene's <default>s
cell = "hemispheric"

[scenes.vary]             # each parameter is a dimension; all combinations are computed
fz = "0:-20:-0.5"         # N; start:stop:step (stop included), a list, "a,b,c", or "@file.txt" with one value per line

[[scenes]]
name = "tangential"
scene = "pad.xml"

[scenes.define]
cell = "hemispheric"
fz = -8                   # N

[scenes.together]         # values taken row by row, as one dimension "step";
fx = "0:4:0.25"           # alternatively, in [[scenes]]: steps = "path.csv" (taxel new steps)
fy = "0:4:0.25"
"""

_STEPS = """\
# taxel deform pad.xml --steps steps.csv -o runs/steps
# The first line after the comments names parameters of the scene; each following line is a step, in this order.
# Forces in N; compression is fz below 0. Here: pressed first, then sheared along x.
fx,fy,fz
0,0,-2
0,0,-4
0,0,-6
0,0,-8
1,0,-8
2,0,-8
3,0,-8
4,0,-8
"""

_CIRCUIT = """\
# taxel render pad.xml --circuit circuit.toml
# A phototransistor as emitter follower, a buffer and a converter, with example values: replace them by your parts'.
# The table [circuit] can also be part of a study file.

[circuit]
supply = 3.3                # V
load_resistance = 22e3      # Ohm, from the emitter to ground; inf for an open emitter
transfer = 8                # A/W, photocurrent per optical power on the phototransistor, gain included

# With a current, the power of LEDs in the scene is a relative factor (1 for equal LEDs); without, the emitted power.
led_current = 0.005         # A
led_efficiency = 0.2        # W/A, optical power per current

saturation_voltage = 0.1    # V, collector-emitter voltage at which half of the photocurrent flows
dark_current = 1e-9         # A, at 25 degrees C
dark_decade = 23            # K, temperature rise for ten times the dark current
temperature = 25            # degrees C
transfer_drift = 0.004      # 1/K, relative
led_drift = -0.005          # 1/K, relative

buffer_gain = 1
adc_bits = 12               # 1 to 24
# adc_reference = 3.3       # V, full scale; by default, the supply
bandwidth = 1000            # Hz, of the low pass before the converter

current_gain = 0            # of the phototransistor; amplifies the shot noise of its base current
flicker_noise = 0           # V at 1 Hz, in a band of 1 Hz; power density proportional to 1/f
flicker_from = 0.1          # Hz, lowest frequency that counts
other_noise = 4e-4          # V, of supply, buffer and converter
"""

_PART = """\
# A photo-reflector: <string name="part" value="part.toml"/> in a photo_reflector; taxel parts part.toml shows it.
# Lengths in mm. x and y are from the middle of the body, seen from above; along x the windows must not overlap.
title = "A reflective sensor"
source = "a datasheet"              # of all numbers that [sources] does not name
body = [2.0, 1.2, 0.6]              # along x, y, z
wavelength = 940                    # nm
resin_index = 1.5                   # of the clear resin above the dies; 1 for none
unknown = ["depth of the dies"]     # what the datasheet does not state

[emitter]
x = -0.5                            # of the middle of the die
y = 0
window_x = -0.5                     # of the middle of the window; by default, over the die
window_y = 0
window_width = 0.6                  # along x
window_length = 0.8                 # along y
window_shape = "rectangle"          # or "obround", which ends in half circles
die_width = 0.3                     # emitters in scenes are square
die_length = 0.3
die_depth = 0                       # below the window
law = "lambertian"                  # or "cosine_power" with an exponent, of dies of depth 0, in air

[detector]
x = 0.5
window_width = 0.7
window_length = 0.8
die_width = 0.4
die_length = 0.4
die_depth = 0

[electrical]                        # figures of the datasheet, by a name with its unit
collector_current_typical_A = 1e-3
dark_current_A = 1e-9

[sources]
resin_index = "of clear epoxies"
"emitter.die_depth" = "assumed"
"detector.die_depth" = "assumed"

# To be compared with the dies above: a flat mirror at a height in mm, and the current relative to the largest.
# distance_curve = [[0.5, 1.0], [1.0, 0.7], [2.0, 0.3]]
"""

_TEXTS = {
    "scene": _SCENE,
    "touch": _TOUCH,
    "study": _STUDY,
    "steps": _STEPS,
    "circuit": _CIRCUIT,
    "part": _PART,
}


def write_template(kind: str, file: str | Path) -> None:
    """Write a commented template, which can be used unchanged.

    Parameters
    ----------
    kind : str
        ``scene`` or, with a ball that presses on the pad, ``touch`` (Mitsuba XML), ``study`` (TOML), ``steps``
        (CSV), ``circuit`` or ``part`` (TOML).
    file : str or Path
        New file, with the suffix of its kind: ``.xml``, ``.toml`` or ``.csv``.

    Raises
    ------
    InputError
        if there is no such kind, or the file exists or cannot be written.
    """
    if not isinstance(kind, str) or kind not in _TEXTS:
        raise InputError(f"kind = {kind!r} is not allowed: one of {', '.join(_TEXTS)} is needed.")
    file = path_of("file", file)
    check_new_file(file, SUFFIXES[kind])
    if file.exists():
        raise InputError(f"{file} exists: the name of a new file is needed.")
    write_text(file, _TEXTS[kind])
