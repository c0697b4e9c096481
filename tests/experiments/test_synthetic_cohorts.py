"""What is committed about the cohorts agrees with itself and with the small subject that is committed too."""

import numpy as np
import pytest

from meshot.metrics.distances import Surface, average_surface_distance
from meshot.provenance import read_results
from meshot.synth.cohorts import read_subject
from meshot.synth.recipe import read_recipe


def test_the_summary_is_that_of_the_scores(root, part_of):
    record = read_results(root / "experiments" / "template_baseline" / "results.json")["results"]
    assert part_of("template_baseline", "run").summarise(record["scores"]) == record["summary"]
    kinds = {(row["cohort"], row["kind"]) for row in record["summary"]}
    assert kinds == {(c, k) for c in ("adni_like", "oasis_like") for k in ("template", "procedural")}


def test_the_small_subject_is_summarised(root, part_of):
    found = part_of("cohorts", "run").scan_summary(read_subject(root / "data_synth" / "sample", "sub-001"))
    assert found["noise"] == pytest.approx(found["noise_set"], rel=0.1)
    assert found["white"] == pytest.approx(440, rel=0.1)
    assert found["grey"] == pytest.approx(310, rel=0.15)
    assert 1000 < found["white_area_cm2"] < found["pial_area_cm2"] < 2500
    assert 2 < found["thickness_mm"] < 3
    assert found["crossing_faces"] == 0


@pytest.mark.thorough
def test_the_template_lies_near_the_small_subject_and_not_on_it(root, part_of):
    baseline = part_of("template_baseline", "run")
    folder = root / "data_synth" / "sample"
    subject = read_subject(folder, "sub-001")
    template = baseline.template_in_standard_space(read_recipe(folder / "recipe.yaml"))
    guess, true = baseline.registered_template(template, subject, "left"), subject.surface("white", "left")
    there, back = Surface(guess), Surface(true)
    samples = [s.sample(2000, np.random.default_rng(0)) for s in (there, back)]
    assert 0.8 < average_surface_distance(back.offsets(samples[0]), there.offsets(samples[1])) < 5
