"""The rate and the number of epochs of each training: trials of rates, their scores, and the two budgets."""

from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.pipeline import LOG, RECORD, InitialSurfaces
from meshot.provenance import read_results, rounded, write_results
from meshot.synth import scans
from meshot.train import read_log
from meshot_book.trainings import alone
from trials.training import SECONDS, Training, has_sides, read_json, segmentation_network, trained_system, trials

#: What a trial says of itself, in the folder in which it is kept.
SCORE = "score.json"


def changes_of(training: Training, config: dict) -> list[str]:
    """The rate and the number of epochs of a training, as changes of settings; none if no rate is tried."""
    entry = config["arms"][training.arm]
    if training.is_trial:
        rate, epochs = training.rate, config["trials"]["epochs"]
    elif not (needed := needed_rates(training, config)):
        return []
    else:
        rates = known_rates(config)
        if missing := [arm for arm in needed if arm not in rates]:
            raise ValueError(
                f"{training.name} needs the rate of {' and '.join(missing)}, which is not chosen: train the trials "
                "first (train.py --only '*_rate*')"
            )
        for arm in needed:
            require_rate_of_protocol(arm, rates[arm], config)
        rate, epochs = rates[training.arm]["rate"], config["budget"]["epochs"]
        if training.budget == SECONDS:
            reference = rates[config["budget"]["reference"]]
            epochs = epochs * reference["seconds_per_epoch"] / rates[training.arm]["seconds_per_epoch"]
    n_epochs = max(1, round(epochs / entry.get("turns", 1)))
    return [f"training.learning_rate={rate:.8f}".rstrip("0"), f"training.n_epochs={n_epochs}"]


def needed_rates(training: Training, config: dict) -> set[str]:
    """The systems whose trials must be there before a training."""
    if training.is_trial or not config["arms"][training.arm].get("rates"):
        return set()
    return {training.arm, config["budget"]["reference"]} if training.budget == SECONDS else {training.arm}


def known_rates(config: dict) -> dict[str, dict]:
    """What is known of the chosen rates, by system."""
    path = Path(config.get("rates", ""))
    return read_results(path)["results"] if path.is_file() else {}


def require_rate_of_protocol(arm: str, entry: dict, config: dict) -> None:
    """Check that a rate was chosen by the trials of the present protocol, as far as the entry tells."""
    own = {f"{trial.rate:g}": trial for trial in trials(config) if trial.arm == arm}
    mend = f"remove {arm} from {config['rates']}, and run train.py --only '*_{arm}_rate*'"
    scores, commands = entry.get("assd_mm", dict.fromkeys(own)), entry.get("commands", [])
    if scores.keys() != own.keys():
        raise ValueError(
            f"the rate of {arm} was chosen from {', '.join(scores)}; the protocol has {', '.join(own)}: {mend}"
        )
    for rate, trial in own.items():
        told = " ".join(trial.changes(config, changes_of(trial, config)))
        made = any(trial.name in command and command.endswith(f" --set {told}") for command in commands)
        if scores[rate] is not None and not made:
            raise ValueError(
                f"the rate of {arm} was chosen by trials with other settings; the protocol asks for {told}: {mend}"
            )


def score_of(folder: Path, trial: Training, config: dict, device: torch.device | None = None) -> dict:
    """The score of the trial in a folder, and the seconds of an epoch.

    The score is the mean ASSD (mm) over the validation subjects of the column of the trials. An arm that is
    ``chosen_by: loss`` also has the mean of its own loss over the last tenth of the steps. Seconds are those of both
    sides of a cohort. If the system does not find a surface, there is no score, and the reason.
    """
    system, side = trained_system(trial, folder, device), config["trials"]["side"]
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    values = []
    for subject in scans(config["cohorts"][trial.cohort], "validation"):
        example = surfaces.example(subject, [(side, "white")], system.needs)
        try:
            found = Surface(system.reconstruct(example.scan)[side, "white"])
        except ValueError as error:
            return {"assd_mm": None, "why": str(error)}
        truth = Surface(example.targets[side, "white"])
        values.append(average_surface_distance(*offsets_between(found, truth, config["evaluation"]["n_points"])))
    turns, n_trained = config["arms"][trial.arm].get("turns", 1), len(HEMISPHERES) if has_sides(trial.kind()) else 1
    seconds = sum(seconds_of_epoch(read_results(folder / f"{part}{RECORD}")) for part in trial.parts(config))
    own = {}
    if config["arms"][trial.arm].get("chosen_by") == "loss":
        logs = [read_log(folder / f"{part}{LOG}") for part in trial.parts(config)]
        steps = [(line["step"], line["loss"]) for log in logs for line in log if "loss" in line]
        late = 0.9 * max(step for step, _ in steps)
        own["loss"] = float(np.mean([loss for step, loss in steps if step >= late]))
    return {"assd_mm": float(np.mean(values)), **own, "seconds_per_epoch": n_trained * seconds / turns}


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
    """
    own, known = [trial for trial in trials(config) if trial.arm == arm], known_rates(config)
    if arm in known:
        require_rate_of_protocol(arm, known[arm], config)
    if arm in known or not own or not all(trial.is_made(config) for trial in own):
        return known
    scores, ended = {}, []
    for trial in own:
        scores[trial.rate] = score = read_json(trial.kept(config) / SCORE)
        changes = changes_of(trial, config)
        # A trial without a finite loss has no records; its score tells the changes.
        files = [trial.file(config, part, RECORD) for part in trial.parts(config)]
        records = [read_results(file) for file in files if file.is_file()]
        wanted, told = trial.settings(config, changes), trial.changes(config, changes)
        completed = [trial.kind().complete(record["config"]) for record in records]
        if score.get("changes", told) != told or any(settings != wanted for settings in completed):
            raise ValueError(
                f"{trial.name} was made with other settings; the protocol asks for {' '.join(told)}: remove the "
                f"folders {trial.kept(config)} and {trial.state(config)}, and run train.py again"
            )
        ended += records if score["assd_mm"] is not None else []
    by = config["arms"][arm].get("chosen_by", "assd_mm")
    found = {rate: score[by] for rate, score in scores.items() if score["assd_mm"] is not None}
    if not found:
        raise ValueError(f"{arm}: no rate has a score; give it other rates in the protocol, and say so there")
    best = min(found, key=found.get)
    choice = {
        "rate": best,
        "assd_mm": {f"{rate:g}": score["assd_mm"] for rate, score in scores.items()},
        **({by: {f"{rate:g}": score.get(by) for rate, score in scores.items()}} if by != "assd_mm" else {}),
        "why_not": {f"{rate:g}": score["why"] for rate, score in scores.items() if score["assd_mm"] is None},
        "seconds_per_epoch": scores[best]["seconds_per_epoch"],
        "seconds_of_trials": sum(record["results"]["cpu_seconds"] for record in ended),
        "machines": sorted({record["processor"] for record in ended}),
        "commands": [record["command"] for record in ended],
    }
    with alone(Path(config["state"]) / "rates", wait=True):
        rates = known_rates(config) | {arm: choice}
        rates = rounded({name: rates[name] for name in config["arms"] if name in rates})
        stands_on = f"training and validation subjects of the synthetic cohort {config['trials']['cohort']}"
        seconds = sum(each["seconds_of_trials"] for each in rates.values())
        command = f"{config.get('train', 'python experiments/comparison/train.py')} --only '*_rate*'"
        write_results(Path(config["rates"]), rates, config, command, stands_on, seconds)
        return rates
