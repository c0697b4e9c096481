"""Train DDOT and CortexODE with each reading of what the paper leaves open, each with its own learning rate.

Run as ``python experiments/ddot/readings.py`` when the cohort exists; ``readings.yaml`` is the protocol. ``--jobs 2``
trains two networks at a time. First every reading is trained for a short time with three rates, then for the whole time
with the rate that was best in validation. Best and last weights are measured on held-out subjects. A stopped run
resumes. There are more protocols for the same steps: ``candidates.yaml`` has local losses, of which only the best are
trained for the whole time; ``controls.yaml`` has further encodings and losses; ``budget.yaml`` has long trainings. The
first three keep their trainings in the same folders, so that what two of them name alike is trained once. Protocols
with the same folders wait for each other. A kept training must have the settings of the protocol.
"""

import contextlib
import sys
from pathlib import Path

import numpy as np
import torch
import yaml
from tqdm import tqdm

import train
from meshot.files import write_whole
from meshot.mesh import write_mesh
from meshot.pipeline import RECORD, InitialSurfaces, segment, segmented_surface
from meshot.provenance import read_results, rounded, write_results
from meshot.synth import Subject, scans
from meshot_book.trainings import alone

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment
from reading_rows import Setting, courses, row_of, tables, tasks_of

from trials.train import train_one
from trials.training import Training, arguments, finals, read_config, segmentation_network

HERE = Path(__file__).parent
SPLITS = ("train", "validation", "test")
STARTS = ("initial", "binary")


def arm_of(reading: dict, rate: float, n_epochs: int, validate_every: int = 2) -> dict:
    """One reading with one learning rate, as an arm of the experiment. The last two arguments count epochs."""
    own = [f"training.learning_rate={rate:.8f}", f"training.n_epochs={n_epochs}"]
    own.append(f"training.validate_every={validate_every}")
    return {"title": "", "system": reading["system"], "changes": [*reading.get("changes", []), *own]}


def rate_arms(protocol: dict, start: str) -> dict[str, dict]:
    """The short trainings from one kind of initial surface: each reading with each of its rates."""
    return {
        f"{name}_{rate:g}": arm_of(reading, rate, protocol["rate_epochs"])
        for name, reading in readings_from(protocol, start).items()
        for rate in rates_of(protocol, reading)
    }


def rates_of(protocol: dict, reading: dict) -> list[float]:
    """The rates that a reading is tried with. A single rate is known and not tried."""
    rates = protocol["rates"][reading["rates"]]
    return rates if len(rates) > 1 else []


def readings_from(protocol: dict, start: str) -> dict[str, dict]:
    """The readings that start from one kind of initial surface."""
    return {name: each for name, each in protocol["readings"].items() if each.get("start", "initial") == start}


def configuration(protocol: dict, start: str, arms: dict[str, dict], state: Path, weights: Path) -> dict:
    """A configuration of the experiment with these arms only."""
    column = {"cohorts": [protocol["cohort"]], "sides": [protocol["side"]], "seeds": [protocol["seed"]]}
    same = {key: protocol[key] for key in ("settings", "cohorts", "segmentation")}
    own = {"initial": protocol[start], "state": str(state), "weights": str(weights), "arms": arms}
    return same | own | {"groups": {"readings": column | {"arms": list(arms)}}}


def score(record: dict) -> float:
    """The mean ASSD on validation subjects, over all validations after half of the steps, in mm."""
    found = record["results"]
    late = [each["validation_loss"] for each in found["validations"] if 2 * each["step"] > found["n_steps"]]
    return float(np.mean(late))


def choice(found: dict[float, float], name: str) -> dict:
    """The rate with the lowest score, and all scores."""
    if not found:
        raise ValueError(f"{name}: no rate kept a finite loss; give the reading smaller rates in the protocol")
    return {"rate": min(found, key=found.get), "assd_mm": {f"{rate:g}": value for rate, value in found.items()}}


def scores(protocol: dict, name: str, config: dict) -> dict[float, float]:
    """The score of each rate of a reading. A rate whose loss was not finite has none."""
    reading, found = protocol["readings"][name], {}
    for rate in rates_of(protocol, reading):
        column, arm = (protocol["cohort"], protocol["side"]), f"{name}_{rate:g}"
        each = Training(*column, arm, None, protocol["seed"], reading["system"])
        if each.is_made(config):
            found[rate] = score(read_results(each.kept(config, RECORD)))
    return found


def finalists(found: dict[str, dict], protocol: dict) -> list[str]:
    """The readings to train for the whole time: all, or those that ``finalists`` of the protocol chooses.

    Those with a known rate have no score and are always among them.
    """
    rule = protocol.get("finalists", {"number": len(found), "always": []})
    lowest = {name: min(each["assd_mm"].values()) for name, each in found.items() if each["assd_mm"]}
    others = sorted(lowest.keys() - set(rule["always"]), key=lambda name: lowest[name])[: rule["number"]]
    return [name for name in found if name in {*rule["always"], *others} or name not in lowest]


def write_binary_surfaces(subjects: list[Subject], surfaces: InitialSurfaces) -> None:
    """Make the missing initial surfaces from the binary mask of white matter instead of its probability."""
    torch.set_num_threads(1)
    for subject in tqdm(subjects, desc="binary surfaces"):
        scan = subject.standard()
        paths = {side: surfaces.path(subject, side, scan) for side in ("left", "right")}
        if all(path.is_file() for path in paths.values()):
            continue
        for side, probability in segment(scan.volume, surfaces.network).items():
            mask = probability.with_data((probability.data > 0.5).astype(np.float64))
            write_mesh(paths[side], segmented_surface(mask).mesh)


def train_arms(config: dict, file: Path, jobs: int = 1, device: str = "cpu") -> float:
    """Train the missing networks of a configuration, which is written to ``file``. Returns the seconds of all."""
    write_whole(file, yaml.safe_dump(config, sort_keys=False))
    if train.main(["--config", str(file), "--jobs", str(jobs), "--device", device]):
        # Each missing training must have stopped because a loss was not finite: a second try from its last state.
        for each in (each for each in finals(config) if not each.is_made(config)):
            with contextlib.suppress(FloatingPointError):
                train_one(each, config, device)
    records = [each.checked_records(config) for each in finals(config) if each.is_made(config)]
    return sum(record["results"]["cpu_seconds"] for those in records for record in those.values())


def train_readings(
    start: str, protocol: dict, jobs: int = 1, device: str = "cpu"
) -> tuple[dict[str, dict], dict, float]:
    """Train all readings with one start. Returns their rates, the configuration of the whole trainings, and seconds."""
    state, own = Path(protocol["state"]), readings_from(protocol, start)
    config = configuration(protocol, start, rate_arms(protocol, start), state, Path(protocol["short"]))
    if start == "binary":
        subjects = [each for split in SPLITS for each in scans(config["cohorts"][protocol["cohort"]], split)]
        subjects += scans(protocol["evaluation"]["cohort"], "test")
        write_binary_surfaces(subjects, InitialSurfaces(protocol["binary"], segmentation_network(config)))
    seconds = train_arms(config, state / f"rates_{start}.yaml", jobs, device) if config["arms"] else 0.0
    rates = {
        name: {"rate": known[0], "assd_mm": {}}
        if len(known := protocol["rates"][each["rates"]]) == 1
        else choice(scores(protocol, name, config), name)
        for name, each in own.items()
    }
    every = protocol.get("validate_every", 2)
    arms = {
        name: arm_of(own[name], rates[name]["rate"], own[name].get("epochs", protocol["epochs"]), every)
        for name in finalists(rates, protocol)
    }
    whole = configuration(protocol, start, arms, state, Path(protocol["weights"])) | {"keep_last": True}
    return rates, whole, seconds + train_arms(whole, state / f"whole_{start}.yaml", jobs, device)


def main(words: list[str] | None = None) -> int:
    """Train all readings and measure them; write their rates, courses, tables and rows."""
    parser = arguments(__doc__, HERE, "readings/results.json")
    parser.set_defaults(config=HERE / "readings.yaml")
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel trainings (default: %(default)s)")
    parser.add_argument("--device", default="cpu", help="for the trainings, such as cuda (default: %(default)s)")
    asked = parser.parse_args(words)
    protocol = read_config(asked.config)
    rates, configs, there, seconds = {}, {}, {}, 0.0
    with alone(Path(protocol["state"]) / "protocol", wait=True):
        for start in (start for start in STARTS if readings_from(protocol, start)):
            own, configs[start], took = train_readings(start, protocol, asked.jobs, asked.device)
            there[start] = [each for each in finals(configs[start]) if each.is_made(configs[start])]
            rates, seconds = rates | own, seconds + took
    partial, settings = asked.output.with_name("partial.jsonl"), protocol["evaluation"]
    setting, rows = Setting(protocol, configs, there, segmentation_network(protocol)), []
    torch.set_num_threads(settings["n_threads"])
    mark = experiment.stamp(__file__, settings)
    # Finished measurements are read from the file.
    for line in experiment.run_jobs(tasks_of(setting), lambda task: row_of(task, setting), partial, mark, "readings"):
        task = {key: line["task"][key] for key in ("start", "arm", "weights", "split", "subject")}
        kind = setting.subjects[task["split"]][task["subject"]].participant.kind
        rows.append(task | {"kind": kind} | line["found"])
        seconds += line["seconds"]
    results = {"rates": rates, "trainings": courses(setting)}
    results |= tables(rows, protocol["readings"], protocol["rival"]) | {"subjects": rows}
    stands_on = f"training, validation and held-out subjects of the synthetic cohort {protocol['cohort']}"
    own = "" if asked.config == HERE / "readings.yaml" else f" --config {asked.config} -o {asked.output}"
    command = f"python experiments/ddot/readings.py{own}"
    write_results(asked.output, rounded(results), protocol, command, stands_on, seconds)
    partial.unlink()
    return 0


if __name__ == "__main__":
    sys.exit(main())
