# Tablerunner: `make help` lists what there is to do.

SHELL := bash
.DEFAULT_GOAL := help
PYTHON ?= python3
# Further arguments for the command behind a target: make test ARGS='-k safety', make demo ARGS=--help
ARGS ?=
# Tests that run side by side: one that computes and two that mostly wait keep two cores busy.
WORKERS ?= 3

SETUP := $(PYTHON) tools/bootstrap
ENV := . ./env.sh
# Robots of others on the same network are neither heard nor disturbed.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

.PHONY: help setup demo test lint bench lock clean

help: ## List the targets
	@echo 'make TARGET [PYTHON=python3.12] [ARGS="..."]'
	@sed -nE 's/^([a-z]+):.*## (.*)/  \1\t\2/p' $(MAKEFILE_LIST) | expand -t 12

setup: ## Make the environment and build every package; quick when nothing changed
	@$(SETUP)

demo: setup ## Deliver meals in the simulated restaurant; results in out/demo/
	@$(ENV) && tablerunner demo $(ARGS)

test: setup ## Run all tests
	@mkdir -p out
	@$(ENV) && python3 -m pytest $$(python3 -c 'import xdist' 2> /dev/null && echo --numprocesses=$(WORKERS)) \
	  --junitxml=out/test.xml $(ARGS)

lint: setup ## Check style, types and spelling
	@$(ENV) && ruff check . && ruff format --check . && mypy && codespell && echo 'lint: nothing found'

bench: setup ## Measure speed; writes out/bench.json
	@mkdir -p out
	@$(ENV) && python3 bench/run.py $(ARGS)

lock: ## Pin the newest packages that requirements/*.in allow in requirements/lock.txt
	@PYTHON=$(PYTHON) tools/lock.sh

clean: ## Remove the environment, the build and caches; out/ stays
	@rm -rf .venv build install log .mypy_cache .pytest_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -not -path './out/*' -prune -exec rm -rf {} +
