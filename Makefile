# Everything a person or CI does with darn. One cargo profile (release) throughout: dependencies are compiled once.
.DEFAULT_GOAL := help
SHELL := bash

CARGO ?= cargo
export DARN_LISTEN ?= 127.0.0.1:8080

.PHONY: help setup build web run test lint fmt docs clean

help: ## Show this list
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{ printf "make %-6s %s\n", $$1, $$2 }'

setup: ## Install what is missing: Debian packages, the glTF validator
	@scripts/setup

build: ## Build target/release/darn
	$(CARGO) build --release --locked

web: ## Build the editor's page, web/dist, after a change in web/
	@scripts/web

run: ## Set up, build, serve on DARN_LISTEN, mend the example through HTTP, go on serving
	@scripts/setup run
	$(CARGO) build --release --locked
	@scripts/run

# `cargo test` builds target/release/darn, too; `cargo build` would compile our crates once more, with other features.
test: ## Set up and run all tests
	@scripts/setup
	$(CARGO) test --release --locked --workspace --lib --bins --tests
	$(CARGO) test --release --locked --workspace --doc
	@scripts/validate

lint: ## Check formatting and lints, warnings are errors
	$(CARGO) fmt --check
	$(CARGO) clippy --release --locked --workspace --all-targets -- -D warnings

fmt: ## Format the code
	$(CARGO) fmt

docs: ## Build the crates' documentation, warnings are errors
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --locked --workspace --no-deps

clean: ## Remove what was built
	$(CARGO) clean
	rm -rf tests/validator/node_modules web/node_modules
