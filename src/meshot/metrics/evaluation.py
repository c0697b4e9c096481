"""The result of an evaluation: values with units, definitions and floors."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Metric:
    """One metric of an evaluation.

    Parameters
    ----------
    name : str
    value : float
    unit : str
        "mm", "%", or what is counted; empty for a dimensionless number.
    definition : str
        An exact definition in one sentence.
    floor : float or None
        The value for two independent samples of the target of the same size. A perfect prediction would have a similar
        value. None if floors were not computed.
    """

    name: str
    value: float
    unit: str
    definition: str
    floor: float | None


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """All metrics between a surface and a target surface. ``print`` shows a table; see also ``definitions``.

    Lengths are in the units of the vertices, assumed to be mm.
    """

    emd: Metric
    swd: Metric
    assd: Metric
    hausdorff: Metric
    normals: Metric
    signed_normals: Metric
    intersecting_faces: Metric
    intersecting_share: Metric
    euler_number: Metric
    area: Metric
    volume: Metric
    edge_variation: Metric
    area_variation: Metric
    smallest_angle: Metric

    def metrics(self) -> list[Metric]:
        """All metrics, in the order in which they are printed."""
        return [getattr(self, field.name) for field in dataclasses.fields(self)]

    def as_dict(self) -> dict[str, dict[str, float | str | None]]:
        """Everything as plain numbers and strings, for JSON."""
        return {name: dataclasses.asdict(getattr(self, name)) for name in self.__dataclass_fields__}

    def definitions(self) -> str:
        """The name and the definition of every metric, one line each."""
        width = max(len(metric.name) for metric in self.metrics())
        return "\n".join(f"{metric.name.ljust(width)}  {metric.definition}" for metric in self.metrics())

    def __repr__(self) -> str:
        rows = [
            (m.name, f"{m.value:.4g}", m.unit, "–" if m.floor is None else f"{m.floor:.4g}") for m in self.metrics()
        ]
        head = ("metric", "value", "unit", "floor")
        name, value, unit, floor = (max(map(len, column)) for column in zip(head, *rows, strict=True))
        return "\n".join(
            f"{n.ljust(name)}  {v.rjust(value)}  {u.ljust(unit)}  {f.rjust(floor)}".rstrip()
            for n, v, u, f in [head, *rows]
        )
