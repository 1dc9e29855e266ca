"""What `taxel tolerance` prints of all samples, and of few exact ones."""

from __future__ import annotations

import json

STUDY = """
scene = "plate.xml"
points = 64
define = { scattering = "lambertian" }
[tolerance]
samples = 16
[tolerance.of]
z = { law = "normal", mean = 0.7, sd = 0.01 }
"""


def test_few_exact_samples(taxel, tmp_path):
    """A plate has no derivatives: the exact samples count alone, which is told."""
    (tmp_path / "all.toml").write_text(STUDY)
    (tmp_path / "few.toml").write_text(STUDY.replace("samples = 16", "samples = 16\nexact = 8"))
    few = taxel("tolerance", "few.toml", "-o", "out")
    assert few.returncode == 0, few.stderr
    assert few.stdout.splitlines()[2].startswith("16 samples, 8 of them exact; spreads are")
    assert few.stdout.splitlines()[4].count("±") == 3  # nominal reading, mean, spread
    assert "results come from the 8 exact samples alone; the other 8 samples add nothing" in few.stdout
    answer = json.loads(taxel("tolerance", "few.toml", "-o", "out", "--json").stdout)
    assert (answer["samples"], answer["exact"]) == (16, 8) and answer["spread"][0]["mean_error"] > 0
    whole = taxel("tolerance", "all.toml", "-o", "out").stdout
    answer, _, heading, _, first, *_ = whole.splitlines()
    assert answer.startswith("Spread (one standard deviation): rest ") and heading.startswith("16 samples; spreads are")
    assert first.count("±") == 3
    answer = json.loads(taxel("tolerance", "all.toml", "-o", "out", "--json").stdout)
    assert set(answer) == {"spread", "shares", "parameters", "notes", "output"}


def test_too_few_exact_samples(taxel, tmp_path):
    (tmp_path / "few.toml").write_text(STUDY.replace("samples = 16", "samples = 16\nexact = 17"))
    told = taxel("tolerance", "few.toml", "-o", "out")
    assert told.returncode == 2 and not (tmp_path / "out").exists()
    assert told.stderr == (
        "taxel: exact = 17 is not allowed: a whole number from 8 to 16, the number of samples, is needed.\n"
    )
