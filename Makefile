# Two commands do everything: make book, make test.
# PYTHON       the Python that makes the environment (3.11 or newer)
# TORCH_INDEX  a wheel index to take torch from, for the CPU build or another CUDA: make book TORCH_INDEX=https://...
# YES          1 lets the two commands install missing system packages without a question: make book YES=1
# VENV         where the environment lives; VENV= (empty) uses the active one, as conda users do
PYTHON ?= python3
TORCH_INDEX ?=
YES ?=
VENV ?= .venv
BIN := $(if $(VENV),$(VENV)/bin/,)
READY := $(if $(VENV),$(VENV)/.ready,)
RUN := $(BIN)python
PIP := $(BIN)pip install -q --disable-pip-version-check

# Set to 1, make experiments also runs the tasks that have no result yet.
PLANNED ?=

COHORTS ?= oasis_like adni_like test_retest
JOBS ?= 2

FILES ?= 5000
TESTS ?=
KILLS ?= 20
MUTANTS ?= 600
WRITERS ?=
# What make test leaves to make test-all.
CHOSEN = -m "not thorough"

# What the system has to provide, looked for before the environment is made and again, by drawing, once it is there.
export YES
NEEDS := python
book notebooks: NEEDS := python display
test test-all: NEEDS := python display browser
PREFLIGHT = tools/preflight.py $(NEEDS)

# A worker on every core, one thread in each. tests/conftest.py says which tests stay together.
PARALLEL = -n logical --dist loadfile --no-loadscope-reorder
# Several kernels and workers share the cores. A thread that waits must sleep: one that spins takes the core of another
# process, and a training on two threads then takes five times as long.
book notebooks test test-all: export OMP_WAIT_POLICY = PASSIVE
# Tests start hundreds of processes: what is compiled is kept, also where PYTHONDONTWRITEBYTECODE is set.
test test-all: export PYTHONDONTWRITEBYTECODE =

.PHONY: help book test test-all experiments stale up-to-date test-everywhere test-wheel fuzz kill mutation html slides pdf report editions notebooks text ledger lab lint warm lock licences audit sbom benchmark cohorts person clean distclean

help:
	@echo "make book       make the environment, run every notebook, render the book from those runs"
	@echo "make test       lint, unit tests, notebooks against their stored outputs, pages in a browser"
	@echo "make test-all   make test with what it leaves out, and the five below: hours"
	@echo "make fuzz       read 5000 damaged files, solve 20000 drawn problems of every loss (FILES=500 for fewer)"
	@echo "make kill       kill everything that writes at 20 random moments each (WRITERS='fit files' KILLS=5 for less)"
	@echo "make mutation   try 600 mutants of the library, and print those that no test sees (MUTANTS=20 for fewer)"
	@echo "make test-everywhere  the numerical tests as on other processors (TESTS=loss for a folder of them)"
	@echo "make test-wheel build the wheel, install it alone, and run what README shows"
	@echo "make audit      look the locked packages up in a database of vulnerabilities (needs a network)"
	@echo "make sbom       write the bill of materials of the lock to build/sbom.json"
	@echo "make html       render the book from the stored outputs (seconds)"
	@echo "make slides     slides of every chapter in build/html/slides, from the rendered book"
	@echo "make pdf        the whole book as build/meshes_as_measures.pdf, from the rendered book"
	@echo "make report     the reproduction report as build/report.pdf, every number of it from a committed result"
	@echo "make editions   a zip for students (no solutions) and one for instructors (board notes) in build/editions, with all that they need"
	@echo "make notebooks  run every notebook and store its outputs (NAME=01_circle_to_polygon for one)"
	@echo "make text       take the text of the chapters over into the notebooks, their outputs untouched (NAME=...)"
	@echo "make experiments  run every experiment that is out of date (PLANNED=1: those without a result, too)"
	@echo "make stale      say which results of experiments are out of date, and why"
	@echo "make up-to-date after an experiment: run the chapters that read it; write ledger, README and the pages on cost"
	@echo "make ledger     write the claims ledger and the table of README from the committed results"
	@echo "make benchmark  install the peers of the benchmark in build/peers, run it (40 minutes), write its tables into the book"
	@echo "make cohorts    make all synthetic subjects in build/cohorts (an hour, resumable; COHORTS=oasis_like for one, JOBS=2)"
	@echo "make person     fetch one adult's scan with FreeSurfer's surfaces (70 MB), and measure ours beside them in build/person"
	@echo "make lab        open the notebooks in JupyterLab"
	@echo "make lint       check style"
	@echo "make lock       solve requirements.lock anew from pyproject.toml"
	@echo "make licences   write THIRD_PARTY.md from the lock and the installed packages"
	@echo "make clean      remove what was built (make distclean: the environment too)"

ifneq ($(VENV),)
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) $(PREFLIGHT)
	@echo "making the environment in $(VENV): some 3 GB, a few minutes"
	@$(PYTHON) -m venv $(VENV)
	@$(if $(TORCH_INDEX),$(PIP) --no-deps --index-url $(TORCH_INDEX) $$(grep '^torch==' requirements.lock))
	@$(PIP) -r requirements.lock
	@$(PIP) --no-deps --no-build-isolation -e .
	@touch $@
endif

book: $(READY)
	@$(RUN) $(PREFLIGHT)
	@$(MAKE) --no-print-directory warm
	@$(RUN) book/run_notebooks.py fresh
	@$(RUN) book/build.py fresh

html: $(READY)
	@$(RUN) book/build.py stored

build/html/index.html: $(READY)
	@$(RUN) book/build.py stored

slides: build/html/index.html
	@$(RUN) book/slides.py

pdf: build/html/index.html
	@$(RUN) tools/preflight.py browser
	@$(RUN) book/pdf.py

report: $(READY)
	@$(RUN) book/report.py

editions: $(READY)
	@$(RUN) book/editions.py

notebooks: $(READY)
	@$(RUN) $(PREFLIGHT)
	@$(MAKE) --no-print-directory warm
	@$(RUN) book/run_notebooks.py store $(NAME)
	@$(RUN) tools/readme_picture.py

text: $(READY)
	@$(RUN) book/run_notebooks.py text $(NAME)

stale: $(READY)
	-@$(RUN) workflow/stale.py

up-to-date: $(READY)
	@$(RUN) workflow/stale.py update

ledger: $(READY)
	@$(RUN) book/make_ledger.py
	@$(RUN) tools/readme_numbers.py

experiments: $(READY)
	@$(RUN) -m snakemake --profile workflow/profiles/laptop --nolock $(if $(filter-out no,$(PLANNED)),--config planned=yes)

test: $(READY)
	@$(RUN) $(PREFLIGHT)
	@$(MAKE) --no-print-directory -j2 lint warm
	OMP_NUM_THREADS=1 MKL_NUM_THREADS=1 $(RUN) -m pytest $(PARALLEL) $(CHOSEN)

test-all: CHOSEN =
test-all: test fuzz kill test-everywhere mutation test-wheel

fuzz: $(READY)
	$(RUN) tests/fuzz/run.py --files $(FILES) --keep build/fuzz
	MESHOT_DRAWN=20000 OMP_NUM_THREADS=1 $(RUN) -m pytest $(PARALLEL) tests/loss/test_drawn_problems.py

audit: $(READY)
	@$(PIP) --upgrade --target build/audit pip-audit==2.10.1
	@PYTHONPATH=$(CURDIR)/build/audit $(RUN) -m pip_audit -s osv -r requirements.lock --no-deps --disable-pip --strict || { \
	  echo "A table above lists known vulnerabilities. An error above means that osv.dev could not be asked: nothing is known."; exit 1; }

test-everywhere: $(READY)
	$(RUN) tests/everywhere/run.py $(TESTS)

mutation: $(READY)
	@$(PIP) --upgrade --target build/cosmic-ray cosmic-ray==8.7.0
	PYTHONPATH=$(CURDIR)/build/cosmic-ray $(RUN) tests/mutation/run.py --sample $(MUTANTS)

kill: $(READY)
	$(RUN) tests/kills/run.py $(WRITERS) --kills $(KILLS)

sbom: $(READY)
	@$(PIP) --upgrade --target build/cyclonedx cyclonedx-bom==7.5.0
	PYTHONPATH=$(CURDIR)/build/cyclonedx $(RUN) -m cyclonedx_py requirements requirements.lock --pyproject pyproject.toml --output-reproducible -o build/sbom.json

# The head of the page is kept, and the table below it written anew.
licences: $(READY)
	@$(PIP) --upgrade --no-deps --target build/licences pip-licenses==5.5.5 prettytable==3.18.0
	@sed -i.before '/^| *Name /,$$d' THIRD_PARTY.md && rm THIRD_PARTY.md.before
	PYTHONPATH=$(CURDIR)/build/licences $(RUN) -m piplicenses --with-system --format=markdown --packages $$(sed 's/[= ].*//' requirements.lock) >> THIRD_PARTY.md

test-wheel: $(READY)
	$(RUN) tests/check_wheel.py

# Kernels are compiled before notebooks run: the first call in a chapter would say that it compiles them.
warm: $(READY)
	@$(BIN)meshot warmup

lint: $(READY)
	$(BIN)ruff check .
	$(BIN)ruff format --check .
	$(BIN)oxlint --deny-warnings src book/_static book/assets
	$(BIN)oxfmt --check 'src/**/*.js' 'src/**/*.css' 'book/_static/*.js' 'book/_static/*.css' 'book/assets/*.js' 'book/assets/*.css'
	$(BIN)djlint --check --lint src
	DENO_NO_UPDATE_CHECK=1 $(BIN)deno check --quiet src/meshot_book/live

lab: $(READY)
	$(BIN)jupyter lab notebooks

benchmark: $(READY)
	@$(PIP) --no-deps --upgrade --target build/peers -r benchmarks/requirements.txt
	$(RUN) benchmarks/losses.py
	$(RUN) benchmarks/ruler.py
	$(RUN) benchmarks/windows.py
	$(RUN) benchmarks/batches.py
	$(RUN) benchmarks/reconstruction.py
	$(RUN) benchmarks/study_cost.py
	@$(RUN) benchmarks/speed_page.py

cohorts: $(READY)
	@for name in $(COHORTS); do \
	  $(BIN)meshot make-cohort $$name build/cohorts/$$name --jobs $(JOBS) || exit 1; done

person: $(READY)
	@$(RUN) experiments/beside_freesurfer/fetch.py
	@$(RUN) experiments/beside_freesurfer/run.py -o build/person/beside_freesurfer.json

# One lock for all platforms, without torch's CUDA packages: pip takes those from the metadata of the CUDA build.
lock:
	@mkdir -p build && $(PIP) uv
	echo torch==2.13.0 | $(RUN) -m uv pip compile --universal --fork-strategy fewest --quiet --python-version 3.11 --extra book --extra test \
	  --extra workflow --no-header --no-annotate --constraint - pyproject.toml > build/solved.lock
	grep -vE '^(nvidia-|cuda-|triton)' build/solved.lock > requirements.lock
	@echo "install the new lock, then write its licences: make licences"

clean:
	rm -rf build .pytest_cache .ruff_cache .hypothesis src/*.egg-info
	find book data_synth experiments notebooks src tests tools -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf .venv
