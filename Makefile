# Ligature: `make run` and `make test` do everything themselves; the second time they cost nothing.

PYTHON := .venv/bin/python
STAMPS := build/stamps
SCENE  ?= scenes/suturing/launch.yaml
MUTANTS ?= 100000
COMMANDS ?= 1000000
KILLS ?= 200
BPY    ?= 4.2.23 4.5.15 5.0.1
NEWEST_BPY := $(lastword $(BPY))

.PHONY: run demo film test test-slow setup lint types check-imports unit fuzz bench soak docs addon test-blender blender-module clean

run: setup
	.venv/bin/ligature run $(SCENE)

test: setup lint unit

setup: $(STAMPS)/compiled

$(STAMPS)/debian: debian-packages.txt debian-packages-tests.txt
	@mkdir -p $(STAMPS)
	@sh .ci/install_debian_packages.sh debian-packages.txt
	@sh .ci/install_debian_packages.sh debian-packages-tests.txt || echo "going on without them: their tests are skipped"
	@touch $@

.venv/pyvenv.cfg: $(STAMPS)/debian
	/usr/bin/python3 -m venv --system-site-packages .venv

$(STAMPS)/python: requirements.txt requirements-dev.txt .venv/pyvenv.cfg
	.venv/bin/pip install --quiet --disable-pip-version-check -r requirements.txt -r requirements-dev.txt
	@touch $@

$(STAMPS)/messages: $(wildcard ros_msgs/*/msg/*.msg ros_msgs/*/srv/*.srv) ros_msgs/generate.sh $(STAMPS)/python
	rm -rf build/python && mkdir -p build/python
	ros_msgs/generate.sh build/python
	echo "$(CURDIR)/build/python" > $$($(PYTHON) -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')/ligature-messages.pth
	@touch $@

$(STAMPS)/package: setup.py $(STAMPS)/messages
	.venv/bin/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

# the rod solver compiles once, here rather than at the first start
$(STAMPS)/compiled: $(STAMPS)/package
	.venv/bin/ligature bench scenes/suturing_small/launch.yaml --seconds 0.1 >/dev/null
	@touch $@

lint: setup
	.venv/bin/ruff format --check simulator tests scenes examples blender_addon
	.venv/bin/ruff check simulator tests scenes examples blender_addon
	.venv/bin/mypy
	.venv/bin/lint-imports

unit: setup blender-module
	BLENDER_MODULES=build/bpy-$(NEWEST_BPY)/bin/python $(PYTHON) -m pytest -m "not slow" tests

# the newest Blender as a Python module, beside the binary; without network the rest is tested without it
blender-module: setup
	@sh .ci/fetch_blender_module.sh $(NEWEST_BPY) build/bpy-$(NEWEST_BPY) 240

# what takes long, or watches real time so closely that other work on the machine disturbs it
test-slow: setup
	$(PYTHON) -m pytest -m slow tests

fuzz: setup
	$(PYTHON) -m tests.fuzz.run --mutants $(MUTANTS)
	$(PYTHON) -m tests.fuzz.commands --commands $(COMMANDS)
	$(PYTHON) -m tests.fuzz.kills --kills $(KILLS)
	LIGATURE_EXAMPLES=new $(PYTHON) -m pytest -q $(shell grep -rl "from hypothesis" tests --include="test_*.py")

bench: setup
	$(PYTHON) -m tests.bench.run

# two simulated hours of servo on both arms, as fast as the machine allows
soak: setup
	$(PYTHON) -m tests.bench.soak

demo: setup
	.venv/bin/ligature demo

# the animation of the README and the pictures of docs/demonstration.md
film: setup
	.venv/bin/ligature demo --out build/film
	.venv/bin/ligature render scenes/peg_transfer/launch.yaml --camera cameraL --width 480 --height 300 --out build/film/peg_transfer
	.venv/bin/ligature render scenes/needle_pick/launch.yaml --camera cameraL --width 480 --height 300 --out build/film/needle_pick
	cp build/film/suture.webp docs/pictures/suture.webp
	cp build/film/suture_7.png docs/pictures/suturing.png
	cp build/film/peg_transfer/cameraL.png docs/pictures/peg_transfer.png
	cp build/film/needle_pick/cameraL.png docs/pictures/needle_pick.png

docs: setup
	$(PYTHON) -c 'from ligature.adf.support import support_table; print(support_table(), end="")' > docs/adf.md

addon: setup
	$(PYTHON) blender_addon/pack.py dist

# all tests of the extension: in the Blender binary, with a window, and in Blender modules from the package index.
# A module that cannot be had is told here and skipped there; the next run asks for it again.
test-blender: setup
	@for version in $(BPY); do sh .ci/fetch_blender_module.sh $$version build/bpy-$$version; done
	BLENDER_MODULES="$(BPY:%=build/bpy-%/bin/python)" $(PYTHON) -m pytest --durations=12 tests/blender

clean:
	rm -rf build devel dist out .venv .mypy_cache .ruff_cache
