from .batches import (
    MeasureBatch as MeasureBatch,
    MeasuresLike as MeasuresLike,
    Pairs as Pairs,
    as_pairs as as_pairs,
    in_float as in_float,
    paired as paired,
)
from .continuous import (
    MeasureLike as MeasureLike,
    SurfaceMeasure as SurfaceMeasure,
    as_measures as as_measures,
    as_point_measures as as_point_measures,
    surface as surface,
)
from .discrete import (
    DiscreteMeasure as DiscreteMeasure,
    Measure as Measure,
    as_probabilities as as_probabilities,
    empirical as empirical,
    varifold as varifold,
    varifold_sample as varifold_sample,
)
