"""The rate and the number of epochs of each training: trials of rates, their scores, and the two budgets."""

from pathlib import Path

import numpy as np
import torch
from units import SECONDS, Unit, has_sides, read_json, records_in, segmentation_network, system_in, trials

from meshot.anatomy import HEMISPHERES
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.pipeline import RECORD, InitialSurfaces
from meshot.provenance import read_results, rounded, write_results
from meshot.synth import scans
from meshot_book.trainings import alone

#: What a trial says of itself, in the folder in which it is kept.
SCORE = "score.json"


def changes_of(unit: Unit, config: dict) -> list[str]:
    """The rate and the number of epochs of a training, as changes of settings.

    Raises
    ------
    ValueError
        If they follow from trials that are not there, or from those of another protocol.
    """
    entry = config["arms"][unit.arm]
    if entry["rates"] is None:
        return []
    turns = entry.get("turns", 1)
    if unit.is_trial:
        rate, epochs = unit.rate, config["trials"]["epochs"]
    else:
        rates = known_rates(config)
        missing = [arm for arm in needed_rates(unit, config) if arm not in rates]
        if missing:
            raise ValueError(
                f"{unit.name} needs the rate of {' and '.join(missing)}, which is not chosen: train the trials first "
                f"(train.py --only '*_rate*')"
            )
        for arm in needed_rates(unit, config):
            require_rate_of_protocol(arm, rates[arm], config)
        rate, epochs = rates[unit.arm]["rate"], _epochs(unit, config, rates)
    return [f"training.learning_rate={rate:.8f}".rstrip("0"), f"training.n_epochs={max(1, round(epochs / turns))}"]


def needed_rates(unit: Unit, config: dict) -> set[str]:
    """The systems whose trials must be there before a training."""
    if unit.is_trial or config["arms"][unit.arm]["rates"] is None:
        return set()
    return {unit.arm, config["budget"]["reference"]} if unit.budget == SECONDS else {unit.arm}


def _epochs(unit: Unit, config: dict, rates: dict[str, dict]) -> float:
    epochs, reference = config["budget"]["epochs"], config["budget"]["reference"]
    if unit.budget != SECONDS:
        return epochs
    return epochs * rates[reference]["seconds_per_epoch"] / rates[unit.arm]["seconds_per_epoch"]


def known_rates(config: dict) -> dict[str, dict]:
    """What is known of the chosen rates, by system."""
    path = Path(config["rates"])
    return read_results(path)["results"] if path.is_file() else {}


def require_rate_of_protocol(arm: str, entry: dict, config: dict) -> None:
    """Check that a rate was chosen by the trials of the present protocol. What an entry does not tell is not checked.

    Raises
    ------
    ValueError
        If it was chosen from other rates, or by trials with other settings.
    """
    own = {f"{unit.rate:g}": unit for unit in trials(config) if unit.arm == arm}
    mend = f"remove {arm} from {config['rates']}, and run train.py --only '*_{arm}_rate*'"
    scores, commands = entry.get("assd_mm", dict.fromkeys(own)), entry.get("commands", [])
    if scores.keys() != own.keys():
        raise ValueError(
            f"the rate of {arm} was chosen from {', '.join(scores)}; the protocol has {', '.join(own)}: {mend}"
        )
    for rate, unit in own.items():
        told = " ".join(unit.all_changes(config, changes_of(unit, config)))
        made = any(unit.name in command and command.endswith(f" --set {told}") for command in commands)
        if scores[rate] is not None and not made:
            raise ValueError(
                f"the rate of {arm} was chosen by trials with other settings; the protocol asks for {told}: {mend}"
            )


def score_of(folder: Path, unit: Unit, config: dict, device: torch.device | None = None) -> dict:
    """The score of the trial in a folder, and the seconds of an epoch.

    The score is the mean ASSD (mm) over the validation subjects of the column of the trials. Seconds are those of both
    sides of a cohort. If the system does not find a surface, there is no score, and the reason.
    """
    system, side = system_in(folder, unit, device), config["trials"]["side"]
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    values = []
    for subject in scans(config["cohorts"][unit.cohort], "validation"):
        example = surfaces.example(subject, [(side, "white")], system.needs)
        try:
            found = Surface(system.reconstruct(example.scan)[side, "white"])
        except ValueError as error:
            return {"assd_mm": None, "why": str(error)}
        truth = Surface(example.targets[side, "white"])
        values.append(average_surface_distance(*offsets_between(found, truth, config["evaluation"]["n_points"])))
    turns, n_trained = config["arms"][unit.arm].get("turns", 1), len(HEMISPHERES) if has_sides(unit.kind()) else 1
    seconds = sum(seconds_of_epoch(record) for record in records_in(folder, unit, config).values())
    return {"assd_mm": float(np.mean(values)), "seconds_per_epoch": n_trained * seconds / turns}


def seconds_of_epoch(record: dict) -> float:
    """The seconds of an epoch of one network, from its first validation to its last one.

    With a single validation, they are those of the whole training.
    """
    results = record["results"]
    first, last = results["validations"][0], results["validations"][-1]
    n_steps, seconds = last["step"] - first["step"], last["cpu_seconds"] - first["cpu_seconds"]
    if n_steps == 0:
        n_steps, seconds = results["n_steps"], results["cpu_seconds"]
    return seconds / n_steps * results["n_steps"] / record["config"]["training"]["n_epochs"]


def choose(config: dict, arm: str) -> dict[str, dict]:
    """Choose the rate of a system if its trials are all there, and write the file of rates. Returns all rates.

    Processes that train different systems wait for each other here: each adds to what the others have written.

    Raises
    ------
    ValueError
        If no rate of the system has a score, or its rate or a trial is that of another protocol.
    """
    own, known = [unit for unit in trials(config) if unit.arm == arm], known_rates(config)
    if arm in known:
        require_rate_of_protocol(arm, known[arm], config)
    if arm in known or not own or not all(unit.is_made(config) for unit in own):
        return known
    for unit in own:
        _require_trial_of_protocol(unit, config)
    chosen = _choice(arm, {unit.rate: read_json(unit.kept(config) / SCORE) for unit in own}, own, config)
    with alone(Path(config["state"]) / "rates", wait=True):
        return _added({arm: chosen}, config)


def _require_trial_of_protocol(unit: Unit, config: dict) -> None:
    # A trial without a finite loss has no records; its score tells the changes.
    changes = changes_of(unit, config)
    wanted, told = unit.settings(config, changes), unit.all_changes(config, changes)
    files = [unit.kept(config) / f"{part}{RECORD}" for part in unit.parts(config)]
    records = [read_results(file) for file in files if file.is_file()]
    same = read_json(unit.kept(config) / SCORE).get("changes", told) == told
    if not same or any(unit.kind().complete(record["config"]) != wanted for record in records):
        raise ValueError(
            f"{unit.name} was made with other settings; the protocol asks for {' '.join(told)}: remove the folders "
            f"{unit.kept(config)} and {unit.state(config)}, and run train.py again"
        )


def _added(chosen: dict[str, dict], config: dict) -> dict[str, dict]:
    rates = known_rates(config) | chosen
    found = rounded({name: rates[name] for name in config["arms"] if name in rates})
    stands_on = f"training and validation subjects of the synthetic cohort {config['trials']['cohort']}"
    seconds = sum(each["seconds_of_trials"] for each in found.values())
    command = "python experiments/comparison/train.py --only '*_rate*'"
    write_results(Path(config["rates"]), found, config, command, stands_on, seconds)
    return found


def _choice(arm: str, scores: dict[float, dict], units: list[Unit], config: dict) -> dict:
    found = {rate: score["assd_mm"] for rate, score in scores.items() if score["assd_mm"] is not None}
    if not found:
        raise ValueError(f"{arm}: no rate has a score; give it other rates in the protocol, and say so there")
    best = min(found, key=found.get)
    ended = [record for unit in units if scores[unit.rate]["assd_mm"] is not None
             for record in records_in(unit.kept(config), unit, config).values()]  # fmt: skip
    return {
        "rate": best,
        "assd_mm": {f"{rate:g}": score["assd_mm"] for rate, score in scores.items()},
        "why_not": {f"{rate:g}": score["why"] for rate, score in scores.items() if score["assd_mm"] is None},
        "seconds_per_epoch": scores[best]["seconds_per_epoch"],
        "seconds_of_trials": sum(record["results"]["cpu_seconds"] for record in ended),
        "machines": sorted({record["processor"] for record in ended}),
        "commands": [record["command"] for record in ended],
    }
