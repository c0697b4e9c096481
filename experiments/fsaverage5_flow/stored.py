"""The fitted flows that are stored beside this file, and their starts."""

from pathlib import Path

from surfaces import start_surface

from meshot.flow import read_velocity, write_velocity
from meshot.mesh import Mesh
from meshot.provenance import read_results
from meshot_book.flows import Leg

HERE = Path(__file__).parent


def write_flow(side: str, task: str, legs: list[Leg], step: float) -> list[str]:
    """Write every leg with coefficients rounded to multiples of ``step``. Returns the names of the files."""
    names = [f"velocity_{side}_{task}_{index}.safetensors.gz" for index in range(len(legs))]
    for name, leg in zip(names, legs, strict=True):
        write_velocity(HERE / name, leg.field, step)
    return names


def read_flow(names: list[str], n_steps: list[int]) -> list[Leg]:
    """Read the legs of :func:`write_flow`."""
    return [Leg(read_velocity(HERE / name), n) for name, n in zip(names, n_steps, strict=True)]


def stored_flow(side: str, task: str) -> tuple[Mesh, list[Leg]]:
    """The start of a task, and the legs of its stored flow to the white surface.

    ``meshot_book.flows.chain_trajectory(legs, start.vertices)`` moves it, step by step.
    """
    record = read_results(HERE / "results.json")
    result = record["results"][side][task]
    if "stored" not in result:
        raise ValueError(f"no flow was kept for {task!r} on the {side}; only those under 'kept' in config.yaml are")
    legs = read_flow(result["stored"]["files"], [fit["n_steps"] for fit in result["fits"]])
    settings = record["config"]
    return start_surface(side, settings["starts"][settings["tasks"][task]["start"]]), legs
