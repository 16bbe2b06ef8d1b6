# `make demo` and `make test` need only Python 3.11+ with venv, and a package index.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
TOOLS := $(VENV)/.tools
DATA ?= $(or $(VDET_DATA),data)
ROADS ?= $(DATA)/roads
TRUTH ?= $(DATA)/project_video_0001-0880.txt
SHARES := {"traffic_cams":3.5, "overpass":2.8, "topview_roads":2, "toll_km39":2, "lake_county_cctv":1.7, \
	"mauritius_cctv":1.8, "delhi_junctions":1.6, "gandhinagar_junctions":1.6, "manaus_misc":1.5, \
	"vietnam_street":1.5, "iran_footbridges":1.5, "boston_roof":1.2, "bdd100k_dashcam":2.2, \
	"bdd_trucks_day":2.2, "bdd_rain":1.5, "bdd_night":1.5, "vehicle_photos":1.5, "bangladesh_roads":1.4, \
	"kathmandu_tripureshwor":1.3, "dawn_fog":1.2}
WEIGHTS ?= build/net/net.onnx
FOLDS ?= 6
STEPS ?= 4000
UNSEEN ?= build/unseen_$(FOLDS)x$(STEPS)
PATCHES = $(DATA)/vehicles.zip $(DATA)/non-vehicles.zip

.DEFAULT_GOAL := help
.PHONY: help demo test lint types tests nettest dist bench net unseen ship soak data model picture \
	commands clean

help:  ## print this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-8s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

demo: $(READY)  ## find vehicles on synthetic roads, train a linear model, compare both with the ground truth
	$(BIN)/vdet demo demo --overwrite

test: lint types tests  ## everything that CI checks

lint: $(TOOLS)  ## check style and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(TOOLS)  ## check types
	$(BIN)/mypy

tests: $(TOOLS)  ## run all tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist worksteal

nettest: $(TOOLS)  ## install torch, and run the tests of training networks
	$(BIN)/python -m pip install --quiet --disable-pip-version-check torch --constraint constraints.txt
	$(BIN)/pytest tests/learn/net

dist: $(TOOLS)  ## build the wheel, install it into an empty environment, and try it there
	rm -rf dist build/try
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	$(PYTHON) -m venv build/try
	build/try/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl \
		--constraint constraints.txt
	cd build/try && bin/vdet info && bin/vdet demo demo

bench: $(TOOLS)  ## measure speed and memory, as ratios of one run
	$(BIN)/python -m benchmarks

soak: $(TOOLS)  ## check that nothing grows in a run of 20,000 frames (minutes, 1 GB in TMPDIR)
	$(BIN)/python -m benchmarks.soak
	$(BIN)/python -m benchmarks.soak --fixed

data:  ## download the patch set (125 MB) into data/; data/README.md says what it is
	cd data && for name in vehicles non-vehicles; do \
		curl --fail --location --continue-at - --output $$name.zip \
			https://s3.amazonaws.com/udacity-sdc/Vehicle_Tracking/$$name.zip || exit 1; \
	done

model: $(TOOLS)  ## train the shipped models again: patches and video in DATA, truth in TRUTH
	mkdir -p build/model
	$(BIN)/vdet train $(PATCHES) -o build/model/start.npz --overwrite
	$(BIN)/vdet mine $(DATA)/project_video.mp4 --truth $(TRUTH) --model build/model/start.npz \
		-o build/model/mined.zip --overwrite
	$(BIN)/vdet train $(PATCHES) build/model/mined.zip -o build/model/svm.npz --overwrite
	$(BIN)/vdet train $(PATCHES) -c seed -o build/model/seed.npz --overwrite
	cp build/model/svm.npz build/model/seed.npz src/vdet/models/

net: $(TOOLS)  ## continue training the shipped network (hours): sets of images in ROADS, video in DATA
	mkdir -p build/net
	$(BIN)/python -m pip install --quiet --disable-pip-version-check torch --constraint constraints.txt
	$(BIN)/vdet train-net $(sort $(wildcard $(ROADS)/*/)) -o build/net/net.onnx --overwrite \
		--video $(DATA)/project_video.mp4 $(TRUTH) --base src/vdet/models/net.onnx \
		--set train.net.steps=15000 \
		--set 'train.net.classes=[car, truck, bus, motorcycle, bicycle, person, other vehicle]' \
		--set 'train.net.weights=$(SHARES)'

unseen: $(TOOLS)  ## measure on cameras left out of FOLDS trainings of STEPS steps, also MODELS (hours)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check torch --constraint constraints.txt
	$(BIN)/python -m benchmarks.unseen $(ROADS) $(DATA)/project_video.mp4 $(TRUTH) --folds $(FOLDS) \
		--steps $(STEPS) --work $(UNSEEN) $(addprefix --model ,$(MODELS))

ship: $(TOOLS)  ## make WEIGHTS, calibrated by the results of make unseen, the shipped network
	$(BIN)/python -m benchmarks.ship $(WEIGHTS) $(addprefix --results ,$(wildcard $(UNSEEN)/results.json))

picture: $(TOOLS)  ## draw the images of the README
	$(BIN)/python -m docs.pictures

commands: $(READY)  ## write docs/commands.md, the help of every command
	$(BIN)/python -m docs.commands

# The versions in constraints.txt are the ones that the tests were last run with.
$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "vdet needs Python 3.11 or later; run make PYTHON=…"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--editable . --constraint constraints.txt
	touch $@

$(TOOLS): $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--editable '.[dev]' --constraint constraints.txt
	touch $@

clean:  ## remove everything that the other targets made, except data/
	rm -rf $(VENV) demo bench.json dist build .mypy_cache .pytest_cache .ruff_cache .hypothesis
