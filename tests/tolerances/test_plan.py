"""What a tolerance study computes, and which studies are refused, in one line."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w

from mitsuba_taxel import InputError
from mitsuba_taxel.studies.plan.batch import batch_from, read_study
from mitsuba_taxel.tolerances.plan import read_plan

HEAD = 'scene = "plate.xml"\npoints = 64\n'
LAWS = """
[tolerance.of]
z = { law = "normal", mean = 0.7, sd = 0.01 }
spacing = { law = "uniform", low = 0.85, high = 0.93 }
"""


@pytest.fixture
def plan(tmp_path):
    """The plan of a study file that says this."""

    def read(text):
        (tmp_path / "study.toml").write_text(text)
        return read_plan(tmp_path / "study.toml")

    return read


@pytest.mark.parametrize("sampling", ["latin_hypercube", "sobol"])
def test_samples_lie_one_in_each_stratum(plan, sampling):
    one = plan(f'{HEAD}[tolerance]\nsamples = 32\nsampling = "{sampling}"\n{LAWS}')
    batch = one.samples(64, None)
    values = {name: np.array(words, dtype=float) for name, words in batch.axes[-1].values.items()}
    share = np.stack([(values["spacing"] - 0.85) / 0.08, one.laws[0].distribution.cdf(values["z"])])
    assert np.array_equal(np.sort(np.floor(32 * share)), np.tile(np.arange(32.0), (2, 1)))
    assert one.batch.axes[-1].values == {"z": ["0.7"], "spacing": ["0.89"]} and one.force == "" and batch.bare
    np.testing.assert_allclose(one.standardised[:, 0], (values["z"] - 0.7) / 0.01)


@pytest.mark.parametrize("points", [0, 64])
def test_samples_are_a_study_of_their_own(plan, tmp_path, points):
    """Also those that are read without random numbers."""
    samples = plan(f"{HEAD}[tolerance]\nsamples = 8\n{LAWS}").samples(points, None)
    (tmp_path / "again.toml").write_text(tomli_w.dumps(samples.as_toml()))
    again = batch_from(read_study(tmp_path / "again.toml"), 0, tmp_path)
    assert again.axes == samples.axes and again.points == (points or None)


def test_the_seed_decides(plan):
    shares = [plan(f"{HEAD}seed = {seed}\n[tolerance]\n{LAWS}").shares for seed in (0, 0, 1)]
    assert np.array_equal(shares[0], shares[1]) and not np.array_equal(shares[0], shares[2])


@pytest.mark.parametrize("sampling", ["latin_hypercube", "sobol"])
def test_the_first_samples_are_exact(plan, tmp_path, sampling):
    head = f'{HEAD}[tolerance]\nsamples = 32\nsampling = "{sampling}"\n'
    whole, part = plan(head + LAWS), plan(head + "exact = 9\n" + LAWS)
    assert (whole.exact, part.exact) == (32, 9) and np.array_equal(whole.shares, part.shares)
    every, first = (one.samples(64, None).axes[-1].values for one in (whole, part))
    assert first == {name: words[:9] for name, words in every.items()} and len(every["z"]) == 32
    assert read_plan(tmp_path / "study.toml", exact=10).exact == 10


def test_few_sobol_points_are_balanced_and_can_be_continued(plan):
    shares = [plan(f'{HEAD}[tolerance]\nsamples = {n}\nsampling = "sobol"\n{LAWS}').shares for n in (16, 64)]
    np.testing.assert_array_equal(shares[0], shares[1][:16])
    assert np.array_equal(np.sort(np.floor(16 * shares[0]), axis=0), np.tile(np.arange(16.0)[:, None], (1, 2)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + '[vary]\nz = "1,2"\n', "has no tolerances"),
        (HEAD + "[tolerance]\nsamples = 16\n", "has no tolerances"),
        (HEAD + "tolerance = 5\n", "has no tolerances"),
        (HEAD + "[tolerance]\nnumber = 3\n" + LAWS, "tolerance: number is not known"),
        (HEAD + "[tolerance]\nsamples = 3\n" + LAWS, "samples = 3"),
        (HEAD + "[tolerance]\nexact = 7\n" + LAWS, "exact = 7 is not allowed: a whole number from 8 to 64"),
        (HEAD + "[tolerance]\nexact = 65\n" + LAWS, "exact = 65 is not allowed: a whole number from 8 to 64"),
        (HEAD + "[tolerance]\nexact = 8.5\n" + LAWS, "exact = 8.5"),
        (HEAD + "[tolerance]\nexact = true\n" + LAWS, "exact = True"),
        (HEAD + '[tolerance]\nsamples = 20\nsampling = "sobol"\n' + LAWS, "a power of 2"),
        (HEAD + '[tolerance]\nsampling = "grid"\n' + LAWS, "sampling = 'grid'"),
        (HEAD + "[vary]\noffset_x = [0, 1]\n" + LAWS, "vary = offset_x"),
        (HEAD + "[vary]\nz = [0.5, 1]\n" + LAWS, "z is varied twice"),
        (HEAD + "[define]\nz = 0.5\n" + LAWS, "z is both varied and given a value"),
        (HEAD + 'derivatives = ["z"]\n' + LAWS, "derivatives is not allowed"),
        ("[[scenes]]\n" + 'scene = "plate.xml"\n' + LAWS, "one scene alone"),
        (HEAD + '[tolerance.of]\nzz = { law = "normal", mean = 1, sd = 0.1 }\n', "zz"),
        (HEAD + '[tolerance.of]\nhole = { law = "normal", mean = 0.1, sd = 0.05 }\n', "not allowed, such as -0.1"),
        (HEAD + '[tolerance.of]\nspacing = { law = "normal", mean = 0.9, sd = 0.02 }\n', "the edge of the body"),
    ],
)
def test_what_is_no_tolerance_study_is_refused(plan, text, said):
    with pytest.raises(InputError) as refused:
        plan(text)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_parts_are_looked_at_together(tmp_path):
    """A spacing that is right beside the scene's own small LED, and would be refused beside the default one."""
    (tmp_path / "scene.xml").write_text("""<scene version="3.9.0">
        <default name="spacing" value="0.3"/>
        <integrator type="taxel_tracer"/>
        <shape type="photo_reflector">
            <float name="spacing" value="$spacing"/>
            <emitter type="annular_led"> <float name="size" value="0.05"/> <float name="hole" value="0"/> </emitter>
            <sensor type="phototransistor"> <float name="width" value="0.2"/> </sensor>
        </shape>
    </scene>""")
    law = '[tolerance.of]\nspacing = {{ law = "uniform", low = {}, high = 0.35 }}\n'
    for low, refused in ((0.13, False), (0.12, True)):
        (tmp_path / "study.toml").write_text('scene = "scene.xml"\npoints = 64\n' + law.format(low))
        if refused:
            with pytest.raises(InputError, match="from 0.125"):
                read_plan(tmp_path / "study.toml")
        else:
            assert read_plan(tmp_path / "study.toml").laws[0].mean == pytest.approx(0.24)
