# make demo   the AMB mass-hanging calibration on the simulated TSBS rig, with a report under runs/
# make test   the tests
# Both set everything up by themselves: a virtual environment, the locked dependencies, the C core.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

# Tests start hundreds of processes: without its bytecode every one of them would compile the project again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test check types bytecode format ci-long faults longer links browser pictures fuzz campaigns plants sound strangers moved golden former bench clean lock setup wheel site gallery

demo: setup
	$(BIN)/bench run amb-calibration --rig tsbs12 --seed 1

test: setup
	$(BIN)/python -m pytest -q -m "not long and not faults and not links and not browser" -n 3 --dist loadgroup --durations=20 --durations-min=8

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(MAKE) -j 2 types bytecode
	$(MAKE) test

types: setup
	$(BIN)/mypy
	$(BIN)/lint-imports

# In a fresh clone each worker would rewrite the assertions of all tests, at once. What is wrong here is told by `make test`.
bytecode: setup
	@$(BIN)/python -m pytest -q --collect-only > /dev/null || true

# Two workers wait for links in real time first, the third computes and gives way (tests/groups.py). Only files with long tests are read.
ci-long: setup
	$(BIN)/python -m pytest -q -m "long and not links and not longer" -n 3 --dist loadgroup --durations=60 --durations-min=10 \
	    $$(grep -rlE "mark\.(long|faults)" tests --include="test_*.py")

faults: setup
	$(BIN)/python -m pytest -q -m faults tests/firmware/test_misbehaviours.py

# What `make ci-long` leaves out of what runs in real time, one by one: the chain's first step on every link, the maximum speed,
# served readings like those that it takes over their limit.
links: setup
	$(BIN)/python -m pytest -q -m links tests/links tests/firmware

# More cases of what `make ci-long` shows by a few, and the pages of procedures whose whole path and figures are in tests/procedures.
longer: setup
	$(BIN)/python -m pytest -q -m longer -n 2 --dist loadgroup --durations=20

# The live page in Chromium, which has to be installed (Debian: apt-get install chromium), or CHROMIUM=/path/to/it.
# Pictures of every state to look at lie under build/browser then.
# WHEEL=dist/levbench-*.whl: of what that wheel installs into an environment of its own, and nothing of this clone.
BROWSED := build/browser-environment
browser: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "playwright>=1.55"
ifdef WHEEL
	$(BIN)/python -m venv --clear --without-pip $(BROWSED)
	$(BIN)/python -m pip --quiet --disable-pip-version-check --python $(BROWSED)/bin/python install --no-index --no-deps $(wildcard $(WHEEL))
endif
	$(if $(WHEEL),INSTALLED=$(BROWSED)) $(BIN)/python -m pytest -q -m browser tests/browser

# The README's pictures anew, by the same tests.
pictures: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "playwright>=1.55"
	PICTURES=docs/pictures $(BIN)/python -m pytest -q -m browser tests/browser/test_pictures.py

fuzz: setup
	$(BIN)/python -m pytest -q -m "hypothesis and not long and not browser" -n 2 --hypothesis-profile=search --timeout 600
	$(BIN)/python -m benchmarks.fuzz --inputs 3000000 --seed 1

campaigns: setup
	$(BIN)/bench campaign tsbs-identification --count 1000 --keep none
	$(BIN)/bench campaign tsbs-identification --count 1000 --first-seed 1000000 --keep none

# Default plans of all procedures on 60 sound rigs, each choice of a plan on 20. It takes hours, goes on by itself, and the
# same command goes on where it was stopped; FIRST is the first seed.
FIRST ?= 0
sound: setup
	mkdir -p runs
	nohup nice $(BIN)/python -m benchmarks.sound runs/sound-$(FIRST).jsonl --first $(FIRST) --count 60 --choices 20 --jobs 2 > runs/sound-$(FIRST).log 2>&1 &
	@echo "look at it with: $(BIN)/python -m benchmarks.sound runs/sound-$(FIRST).jsonl --report"

# Every procedure that the foreign rigs of the tests can run, with its default plan: what is wrong, what is beyond 3 U.
strangers: setup
	mkdir -p runs
	nice $(BIN)/python -m benchmarks.sound runs/strangers.jsonl --first 0 --count 3 --jobs 2 $(addprefix --rig ,$(wildcard tests/strangers/*.toml))

# Every drawn number moved by three half widths, for every procedure: caught, harmless, in the budget, or listed on the report.
moved: setup
	mkdir -p runs
	$(BIN)/python -m benchmarks.moved --all runs/moved.jsonl

# Planted defects by size, for every procedure that has a file in benchmarks/planted: hours; the same command goes on where it was stopped.
plants: setup
	nice $(BIN)/python benchmarks/plants.py --seeds 60 --jobs 2

# The numbers of two commits beside each other, bit for bit: make golden OLD=main~1
OLD ?= HEAD~1
NEW ?= HEAD
golden: setup
	$(BIN)/python benchmarks/golden.py $(OLD) $(NEW)

# Recordings and calibrations that an older commit makes, read by this one: make former FORMER=937c3b9
FORMER ?= HEAD~1
former: setup
	$(BIN)/python -m benchmarks.former_recordings $(FORMER)

bench: setup
	$(BIN)/python benchmarks/analysis.py
	$(BIN)/python benchmarks/core.py
	$(BIN)/python benchmarks/one_axis_core.py
	$(BIN)/python benchmarks/decode.py
	$(BIN)/python benchmarks/path.py
	$(BIN)/python benchmarks/recorder.py
	$(BIN)/python benchmarks/runup.py
	$(BIN)/python benchmarks/startup.py
	$(BIN)/python benchmarks/slcan.py --seconds 10
	$(BIN)/python benchmarks/serial_link.py --seconds 10
	$(BIN)/python benchmarks/recorder_fast.py --seconds 10
	$(BIN)/python benchmarks/roundtrip.py
	$(BIN)/python benchmarks/capture.py
	$(BIN)/python benchmarks/dead_host.py --runs 3

# A wheel for this platform, for every Python: compiled, named by what it needs of the system's C library, and checked. It is in dist/.
TOOLS := build/wheel-tools
wheel: setup $(TOOLS)/.ready
	rm -rf build/lib build/bdist.* build/wheel dist
	nice $(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir build/wheel .
ifeq ($(shell uname -s),Linux)
	PATH="$(CURDIR)/$(TOOLS)/bin:$$PATH" auditwheel repair --wheel-dir dist build/wheel/levbench-*.whl
	$(TOOLS)/bin/auditwheel show dist/levbench-*.whl
else
	mkdir -p dist && cp build/wheel/levbench-*.whl dist
endif
	$(BIN)/python install/check_wheel.py dist/levbench-*.whl

$(TOOLS)/.ready: install/wheel-tools.txt
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r install/wheel-tools.txt
	@touch $@

# The documentation as a site, in build/site; with the reports of the campaigns of `make gallery`, if it was made.
SITE_TOOLS := build/site-tools
site: $(SITE_TOOLS)/.ready
	$(PYTHON) docs/site/collect_pages.py build/pages $(wildcard runs/gallery/*.campaign-*)
	$(SITE_TOOLS)/bin/zensical build --clean --strict --config-file mkdocs.yml

$(SITE_TOOLS)/.ready: docs/site/tools.txt
	$(PYTHON) -m venv $(SITE_TOOLS)
	$(SITE_TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps -r docs/site/tools.txt
	@touch $@

GALLERY := tsbs-identification amb-motion
gallery: setup
	for name in $(GALLERY); do \
	    $(BIN)/bench campaign $$name --seed 1 --short --go-on --out runs/gallery || test $$? -ne 2 || exit 2; done

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

setup: $(READY)
	@$(BIN)/python -c "import sim_backend.core"

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, found " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	@touch $@

lock:
	uv pip compile pyproject.toml --extra dev --extra dask --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	    --no-header --quiet -o requirements.lock

clean:
	rm -rf .venv build dist *.egg-info sim_backend/core/*.so
