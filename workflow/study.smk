# Reconstruct a BIDS data set on a laptop or a cluster: one job for each participant, then the table and the quality page.
#
#   python -m snakemake -s workflow/Snakefile --profile workflow/profiles/laptop --config bids=BIDS out=OUT
#   python -m snakemake -s workflow/Snakefile --profile workflow/profiles/slurm --config bids=BIDS out=OUT
#
# Settings (--config NAME=VALUE, or a file: --configfile study.yaml):
#   bids          the data set
#   out           the folder of the results, new or from an earlier run
#   layout        flat (default), freesurfer or bids
#   participants  labels separated by spaces (default: all)
#   options       more words for meshot reconstruct, such as "--derivatives MASKS"
#
# A participant that fails does not stop the others. Its reason stands in OUT/subjects.tsv and OUT/logs, and the next
# start tries it again. The state of the workflow is in the folder OUT_state beside the results.
from pathlib import Path
from shlex import quote

for name in ("bids", "out"):
    if name not in config:
        raise ValueError(f"there is no setting {name}; give it: --config bids=BIDS out=OUT")
BIDS, OUT = Path(config["bids"]), Path(config["out"])
STATE = Path(f"{OUT}_state")
LAYOUT = config.get("layout", "flat")
PRESENT = sorted(folder.name.removeprefix("sub-") for folder in BIDS.glob("sub-*") if folder.is_dir())
if not PRESENT:
    raise ValueError(f"{BIDS} holds no participant; name a BIDS data set, with folders such as sub-01")
CHOSEN = str(config.get("participants", "")).split() or PRESENT
if UNKNOWN := sorted(set(CHOSEN) - set(PRESENT)):
    raise ValueError(f"{BIDS} has no participant {', '.join(UNKNOWN)}; choose among its folders sub-*")


container: "meshot.sif"


rule study:
    """The table of all subjects, and the page to look at them."""
    input:
        expand(STATE / "sub-{participant}.done", participant=CHOSEN),
    output:
        touch(STATE / "study.done"),
    params:
        bids=quote(str(BIDS)),
        out=quote(str(OUT)),
    localrule: True
    shell:
        "meshot reconstruct {params.bids} {params.out} group && meshot quality {params.out}"


rule participant:
    """All sessions of one participant."""
    output:
        touch(STATE / "sub-{participant}.done"),
    log:
        STATE / "sub-{participant}.log",
    params:
        bids=quote(str(BIDS)),
        out=quote(str(OUT)),
        layout=quote(LAYOUT),
        options=config.get("options", ""),
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    shell:
        "meshot reconstruct {params.bids} {params.out} participant --participant-label {wildcards.participant}"
        " --layout {params.layout} --threads {threads} {params.options} > {log} 2>&1"


# Where a participant failed, the table and the page of the others are still written.
onerror:
    shell(f"meshot reconstruct {quote(str(BIDS))} {quote(str(OUT))} group && meshot quality {quote(str(OUT))}")
