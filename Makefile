# make demo   a bucket digs in sand, through ROS topics; make demo VIEW=1 also opens the viewer
# make test   all quick tests, on all cores;  make test-full also those that take minutes
# Needs Python 3.12 and make; everything else is installed into .venv.

PYTHON ?= python3
VENV := .venv
READY := $(VENV)/.ready
SCENE ?= dig
OUT ?= out
VIEW ?=

.PHONY: demo run test test-full lint clean

demo: $(READY)
	$(VENV)/bin/sand_sim demo "$(SCENE)" --out "$(OUT)" $(if $(VIEW),--view)

run: $(READY)
	$(VENV)/bin/sand_sim run "$(SCENE)" --out "$(OUT)" $(if $(VIEW),--view)

test: $(READY)
	$(VENV)/bin/python -m pytest -n logical --dist loadgroup -m "not slow"

test-full: $(READY)
	$(VENV)/bin/python -m pytest -n logical --dist loadgroup

lint: $(READY)
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .

# The file is written last, so that an interrupted set-up is done again.
$(READY): setup.py constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info[:2] == (3, 12) else "sand_sim needs Python 3.12, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12")'
	@echo "setting up $(VENV), once, this takes a minute"
	$(PYTHON) -m venv $(VENV)
	touch $(VENV)/COLCON_IGNORE
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[ros,figures,test]'
	touch $(READY)

clean:
	rm -rf $(VENV) "$(OUT)" build install log *.egg-info
