"""A small study with a deformed pad, and the page that is made of it."""

from __future__ import annotations

import pytest

SCENE = """<scene version="3.9.0">
    <default name="fz" value="-0.3"/> <default name="cell" value="parallelepiped"/>
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad">
        <string name="cell" value="$cell"/> <integer name="rows" value="1"/> <integer name="columns" value="2"/>
        <float name="mesh_size" value="2.5"/> <vector name="force" value="0, 0, $fz"/>
        <bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf>
    </shape>
    <shape type="photo_reflector">
        <integer name="rows" value="1"/> <integer name="columns" value="2"/>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>
    <shape type="rectangle"> <transform name="to_world"> <scale value="20"/> </transform> </shape>
</scene>"""


@pytest.fixture(scope="session")
def study_folder(tmp_path_factory):
    """Results over two shapes and three forces."""
    from mitsuba_taxel import sweep

    folder = tmp_path_factory.mktemp("study")
    scene = folder / "one & two.xml"
    scene.write_text(SCENE)
    output = folder / "results"
    sweep(scene, {"cell": "parallelepiped,cylindrical", "fz": "0,-0.5,-1"}, points=64, output=output)
    return output


@pytest.fixture(scope="session")
def page(study_folder, blank_figures):
    """The study's page, with its figures painted."""
    from matplotlib.figure import Figure

    from mitsuba_taxel.report.page import write_report

    file = study_folder.parent / "report.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", blank_figures)
        assert write_report(study_folder, file) == []
    return file
