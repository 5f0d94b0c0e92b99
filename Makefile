# make demo   the clock tower: three clouds and six picks in, one measured similarity out
# make test   everything that can be checked here
# make lint   style, types and the direction of imports
# make bench  time and memory, beside what a user would use instead

PYTHON ?= python3
VENV ?= .venv
DEMO ?= demo
BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip install --disable-pip-version-check --quiet

# library:packages. The PDF is set by Pango, perspective views are drawn by Mesa.
REPORT_LIBRARIES = libpango-1.0.so.0:libpango-1.0-0 libpangoft2-1.0.so.0:libpangoft2-1.0-0 \
  libharfbuzz-subset.so.0:libharfbuzz-subset0 libEGL.so.1:libegl1+libgl1-mesa-dri
# Open3D, an independent implementation that the tests compare with, draws: it needs these to load.
TEST_LIBRARIES = libGL.so.1:libgl1 libgomp.so.1:libgomp1 libX11.so.6:libx11-6

# Qt loads its window platform through these.
PANEL_LIBRARIES = libEGL.so.1:libegl1+libgl1-mesa-dri libGL.so.1:libgl1 libdbus-1.so.3:libdbus-1-3 \
  libfontconfig.so.1:libfontconfig1 libxkbcommon-x11.so.0:libxkbcommon-x11-0 \
  libxcb-cursor.so.0:libxcb-cursor0 libxcb-icccm.so.4:libxcb-icccm4 libxcb-image.so.0:libxcb-image0 \
  libxcb-keysyms.so.1:libxcb-keysyms1 libxcb-render-util.so.0:libxcb-render-util0 \
  libxcb-shape.so.0:libxcb-shape0 libxcb-xinerama.so.0:libxcb-xinerama0

.PHONY: help demo test lint bench clean
help:
	@sed -n '1,4s/^# //p' Makefile

demo: $(VENV)/.installed
	$(BIN)/trigpoint demo --out $(DEMO)

# A file's tests stay together: they share what they build.
test: lint
	$(BIN)/python -m pytest -n logical --maxprocesses 4 --dist loadfile

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed-dev
	$(BIN)/python tests/benchmarks/run.py

clean:
	rm -rf $(VENV) build dist $(DEMO)

# Names in `missing` the packages of those libraries that the system lacks.
define find_missing
	missing=""; for pair in $(1); do \
	  PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep -q "$${pair%%:*}" || \
	    missing="$$missing $$(echo $${pair##*:} | tr + ' ')"; \
	done
endef

# A system package is installed where it is missing and the user may; otherwise it is named.
define install_system_packages
	if [ -n "$$missing" ]; then \
	  if [ "$$(id -u)" = 0 ]; then as=""; elif sudo -n true 2>/dev/null; then as="sudo"; else as="no"; fi; \
	  if [ "$$as" != no ] && command -v apt-get >/dev/null; then \
	    $$as apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$as apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	  else \
	    echo "Missing system packages:$$missing. Please install them (on Debian: apt-get install$$missing)." >&2; $(1); \
	  fi; \
	fi
endef

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "trigpoint needs Python 3.11 or later; $(PYTHON) is $$($(PYTHON) --version 2>&1). Say which: make PYTHON=python3.12 ..." >&2; exit 1; }
	@missing=""; $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  missing=" $$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"; \
	$(call install_system_packages,exit 1)
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	@$(call find_missing,$(REPORT_LIBRARIES)); $(call install_system_packages,echo "The report is made without what needs them." >&2)
	$(PIP) -e ".[reporting]"
	@touch $@

# What has no wheel on this machine is left out: its tests skip and say so.
$(VENV)/.installed-dev: pyproject.toml $(VENV)/.installed
	@$(call find_missing,$(TEST_LIBRARIES) $(PANEL_LIBRARIES)); $(call install_system_packages,echo "The panel and the comparisons with Open3D are skipped where they need them." >&2)
	$(PIP) -e ".[dev]"
	@for oracle in $$($(BIN)/python -c 'import tomllib; print(*(r.split(";")[0].replace(" ", "") for r in tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["oracles"]))'); do \
	  $(PIP) --only-binary :all: "$$oracle" || echo "No wheel of $$oracle here: its comparisons are skipped." >&2; \
	done
	@touch $@
