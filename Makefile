# Ligature: `make run` and `make test` do everything themselves; the second time they cost nothing.

PYTHON := .venv/bin/python
PIP    := .venv/bin/pip --disable-pip-version-check install --progress-bar off
STEP   := sh .ci/step.sh
STAMPS := build/stamps
SCENE  ?= scenes/suturing/launch.yaml
MUTANTS ?= 100000
READERS ?= 100000
SCENES ?= 10000
PATHS ?= 200
RELEASES ?= 100
COMMANDS ?= 1000000
KILLS ?= 200
PLACINGS ?= 200
SIGNALS ?= 40
PAGE_MESSAGES ?= 3000
BPY    ?= 4.2.23 4.5.15 5.0.1
NEWEST_BPY := $(lastword $(BPY))

.PHONY: run demo film test test-slow setup developers lint types check-imports unit fuzz bench curves contact-sheet lerobot-reader soak docs site wheel addon test-blender blender-module clean

run: setup
	.venv/bin/ligature run $(SCENE)

test: developers lint unit

# what running needs, and nothing else
setup: $(STAMPS)/compiled

# what `make test` and its likes need beside
developers: setup $(STAMPS)/debian-tests $(STAMPS)/python-tests

$(STAMPS)/debian: debian-packages.txt
	@mkdir -p $(STAMPS)
	@echo "The first start sets everything up, in 3 to 10 minutes: Debian packages, Python packages, ROS messages, compilation."
	@sh .ci/install_debian_packages.sh debian-packages.txt
	@touch $@

.venv/pyvenv.cfg: $(STAMPS)/debian
	@$(STEP) "creating the Python environment .venv, about 10 s" /usr/bin/python3 -m venv --system-site-packages .venv

$(STAMPS)/python: requirements.txt .venv/pyvenv.cfg
	@$(STEP) "installing the Python packages of requirements.txt, about a minute" $(PIP) -r requirements.txt
	@touch $@

$(STAMPS)/messages: $(wildcard ros_msgs/*/msg/*.msg ros_msgs/*/srv/*.srv) ros_msgs/generate.sh $(STAMPS)/python
	@rm -rf build/python && mkdir -p build/python
	@$(STEP) "generating the ROS messages, about 10 s" ros_msgs/generate.sh build/python
	@echo "$(CURDIR)/build/python" > $$($(PYTHON) -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')/ligature-messages.pth
	@touch $@

$(STAMPS)/package: setup.py pyproject.toml $(STAMPS)/messages
	@$(STEP) "installing the simulator into .venv, about 10 s" $(PIP) --no-deps --no-build-isolation -e .
	@touch $@

# the kernels compile once, here rather than at the first start
$(STAMPS)/compiled: $(STAMPS)/package
	@$(STEP) "compiling the simulator's kernels for this machine, 1 to 3 minutes" .venv/bin/ligature compile
	@touch $@

# the simulator runs without these; what apt does not offer is named, and its tests are skipped
$(STAMPS)/debian-tests: debian-packages-tests.txt $(STAMPS)/debian
	@sh .ci/install_debian_packages.sh debian-packages-tests.txt --optional || echo "going on without them: their tests are skipped"
	@touch $@

$(STAMPS)/python-tests: requirements-dev.txt $(STAMPS)/package
	@$(STEP) "installing the Python packages of requirements-dev.txt, about a minute" $(PIP) -r requirements.txt -r requirements-dev.txt
	@touch $@

lint: $(STAMPS)/python-tests
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy
	.venv/bin/lint-imports

# they watch real time, and mostly wait: all others run meanwhile, where they leave time
AT_ANY_TIME := $(foreach test,conversion launch_files messages names package,tests/ros/test_$(test).py) \
  $(foreach test,address assist desk pictures pursuit tissue,tests/cockpit/test_$(test).py)
IN_REAL_TIME := $(filter-out $(AT_ANY_TIME),$(wildcard tests/ros/test_*.py tests/cockpit/test_*.py)) \
  $(foreach test,ambf_simulator master physics recorder replay set_up supervisor,tests/cli/test_$(test).py)
unit: developers blender-module
	BLENDER_MODULES=build/bpy-$(NEWEST_BPY)/bin/python sh .ci/unit_tests.sh $(PYTHON) $(IN_REAL_TIME)

# the newest Blender as a Python module, beside the binary; without network the rest is tested without it
blender-module: developers
	@sh .ci/fetch_blender_module.sh $(NEWEST_BPY) build/bpy-$(NEWEST_BPY) 240

# what takes long, or watches real time so closely that other work on the machine disturbs it
test-slow: developers
	$(PYTHON) -m pytest -m slow tests --ignore=tests/ros/test_odd_clients.py
	$(PYTHON) -m pytest -m slow tests/ros/test_odd_clients.py

fuzz: developers
	$(PYTHON) -m tests.fuzz.run --mutants $(MUTANTS)
	$(PYTHON) -m tests.fuzz.run --scenes $(SCENES)
	$(PYTHON) -m tests.fuzz.run --readers $(READERS)
	$(PYTHON) -m tests.fuzz.run --paths $(PATHS)
	$(PYTHON) -m tests.fuzz.release --trials $(RELEASES)
	$(PYTHON) -m tests.fuzz.commands --commands $(COMMANDS)
	$(PYTHON) -m tests.fuzz.kills --kills $(KILLS)
	$(PYTHON) -m tests.fuzz.placing --trials $(PLACINGS)
	$(PYTHON) -m tests.fuzz.signals --rounds $(SIGNALS)
	$(PYTHON) -m tests.fuzz.page $(PAGE_MESSAGES)
	LIGATURE_EXAMPLES=new $(PYTHON) -m pytest -q tests/cockpit/test_intake.py $(shell grep -rl "from hypothesis" tests --include="test_*.py")

bench: developers
	$(PYTHON) -m tests.bench.run

# docs/pictures/learning_curves.png: three trainings of three tasks; needs the extra `train`
CURVES := build/curves
curves: developers
	mkdir -p $(CURVES)
	set -e; for seed in 0 1 2; do \
	  $(PYTHON) examples/scale_out.py reach $(CURVES)/reach_$$seed.onnx --seed $$seed --rounds 5 --episodes 10; \
	  $(PYTHON) examples/scale_out.py pick $(CURVES)/pick_$$seed.onnx --seed $$seed --first 60 --rounds 4 --episodes 20 --epochs 150; \
	  $(PYTHON) examples/scale_out.py insert $(CURVES)/insert_$$seed.onnx --seed $$seed --rounds 4 --episodes 8 --noise 0.1; \
	done
	$(PYTHON) examples/learning_curves.py docs/pictures/learning_curves.png "episodes shown" \
	  $(foreach task,reach pick insert,$(task)=$(CURVES)/$(task)_0.csv,$(CURVES)/$(task)_1.csv,$(CURVES)/$(task)_2.csv)

# LeRobot's own reader on exports, in an environment of its own: numpy 2, torch, Python 3.12; 5.4 GB
LEROBOT := build/lerobot
lerobot-reader: developers
	@test -x $(LEROBOT)/bin/python || python3.12 --version >/dev/null 2>&1 || { echo "LeRobot needs Python 3.12; install python3.12"; exit 1; }
	@test -x $(LEROBOT)/bin/lerobot-info || { python3.12 -m venv $(LEROBOT) && $(STEP) "installing LeRobot, 5.4 GB, some minutes" \
		$(LEROBOT)/bin/pip --disable-pip-version-check install --progress-bar off 'lerobot[dataset]==0.6.1'; }
	$(PYTHON) -m pytest tests/datasets/test_lerobot_reader.py

# every scene drawn with and without shaders of its own, in build/contact_sheet.png
contact-sheet: setup
	$(PYTHON) -m tests.bench.contact_sheet

# two simulated hours of servo on both arms, and a simulated day of a whole run with its page, as fast as the machine allows
soak: developers
	$(PYTHON) -m tests.bench.soak
	$(PYTHON) -m tests.bench.soak_served

demo: setup
	.venv/bin/ligature demo

# the animation of the README and the pictures of docs/demonstration.md
film: setup
	.venv/bin/ligature demo --out build/film
	.venv/bin/ligature demo --tissue --out build/film/tissue
	.venv/bin/ligature demo --knot --out build/film/knot
	.venv/bin/ligature render scenes/peg_transfer/launch.yaml --camera cameraL --width 480 --height 300 --out build/film/peg_transfer
	.venv/bin/ligature render scenes/needle_pick/launch.yaml --camera cameraL --width 480 --height 300 --out build/film/needle_pick
	cp build/film/suture.webp docs/pictures/suture.webp
	cp build/film/tissue/suture.webp docs/pictures/suture_tissue.webp
	cp build/film/knot/suture.webp docs/pictures/close_wound.webp
	cp build/film/suture_7.png docs/pictures/suturing.png
	cp build/film/peg_transfer/cameraL.png docs/pictures/peg_transfer.png
	cp build/film/needle_pick/cameraL.png docs/pictures/needle_pick.png

# wheel and source distribution in dist/, as others install them
wheel: developers
	@rm -rf dist/ligature_sim-*
	@$(STEP) "building the source distribution and the wheel, about 15 s" $(PYTHON) -m build --no-isolation --outdir dist

# the pages of docs and the reference made from the code, in build/site; no network, every warning is an error
site: developers
	@$(STEP) "building the site in build/site, about a minute" $(PYTHON) docs/site/build.py build/site

docs: setup
	$(PYTHON) -c 'from ligature.adf.support import support_table; print(support_table(), end="")' > docs/adf.md

addon: developers
	$(PYTHON) blender_addon/pack.py dist

# all tests of the extension: in the Blender binary, with a window, and in Blender modules from the package index.
# A module that cannot be fetched is named here and skipped there; the next run asks for it again.
test-blender: developers
	@for version in $(BPY); do sh .ci/fetch_blender_module.sh $$version build/bpy-$$version; done
	BLENDER_MODULES="$(BPY:%=build/bpy-%/bin/python)" $(PYTHON) -m pytest --durations=12 tests/blender

clean:
	rm -rf build devel dist out .venv .mypy_cache .ruff_cache
