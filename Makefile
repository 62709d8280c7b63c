# The README's two commands, and what maintainers need. Each builds .venv from environment.lock first.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
export TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
LOCK_DATE ?= $(shell date -u +%F)
# A folder or page with the CPU wheels of torch, for renewing the lock only.
TORCH_WHEELS ?= $(TORCH_INDEX)/torch/
RUN = .venv/bin/python -m drivelib

.PHONY: reproduce test verify-all lab site lock venv

venv:
	@$(PYTHON) -m drivelib.bootstrap

# CHECK=1 compares with the committed bytes instead of writing them.
reproduce: venv
	@$(RUN) reproduce $(if $(CHECK),--check --keep build/check)

test: venv
	@$(RUN) test

# What is too slow for CI: the whole pack elsewhere and otherwise, 200 kernels, and other processors where QEMU is installed.
verify-all: venv
	@$(RUN) verify
	@$(RUN) test -m slow
	@if command -v qemu-x86_64 > /dev/null; then $(RUN) verify --cpu Haswell --cpu Skylake-Client --cpu EPYC; \
	    else echo "skipped: other processors, for qemu-x86_64 is not installed (Debian: qemu-user)"; fi

lab: venv
	@$(RUN) lab

# Everything as pages to read in a browser: build/site/index.html.
site: venv
	@$(RUN) site

# The one way to renew environment.lock: make lock LOCK_DATE=2026-11-20
lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --quiet uv==0.13.9
	build/lock/bin/uv pip compile pyproject.toml --upgrade --extra test --extra site --universal --fork-strategy fewest \
	    --python-version 3.11 --generate-hashes --exclude-newer $(LOCK_DATE) --find-links $(TORCH_WHEELS) \
	    --custom-compile-command "make lock LOCK_DATE=$(LOCK_DATE)" --no-annotate --quiet -o environment.lock
